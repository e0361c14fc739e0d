#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/worlds.h"

namespace limn::test {

// Writes the bench's plan and world with fewer pixels into `folder` and returns the plan's path.
inline std::filesystem::path small_plan(const std::filesystem::path& folder) {
  const std::filesystem::path config = config_folder();
  nlohmann::json world = read_json(config / "worlds/bench.json"),
                 plan = read_json(config / "plans/bench.json");
  world["scene"] = (config / "scenes/door").string();
  shrink(0.625, &world["cameras"][0]);
  shrink(0.25, &world["projectors"][0]);
  plan["world"] = "world.json";
  plan["board"] = "charuco:8x6:55mm";
  write_json(folder / "world.json", world);
  return write_json(folder / "plan.json", plan);
}

}  // namespace limn::test
