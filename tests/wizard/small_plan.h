#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "core/file.h"

namespace limn::test {

inline nlohmann::json read_json(const std::filesystem::path& path) {
  return nlohmann::json::parse(read_file(path).value(), nullptr, true, true);
}

// Scales an imager's width and height by `share`; its field of view stays.
inline void shrink(double share, nlohmann::json* imager) {
  for (auto& side : (*imager)["size"]) side = static_cast<int>(share * side.get<int>());
  auto& values = (*imager)["lens"]["values"];
  for (std::size_t i = 0; i < 2; ++i) values[i] = share * values[i].get<double>();
  for (std::size_t i = 2; i < 4; ++i) values[i] = share * (values[i].get<double>() + 0.5) - 0.5;
}

// Writes the bench's plan and world with fewer pixels into `folder` and returns the plan's path.
inline std::filesystem::path small_plan(const std::filesystem::path& folder) {
  const std::filesystem::path config = std::filesystem::path(LIMN_SOURCE_DIR) / "config";
  nlohmann::json world = read_json(config / "worlds/bench.json"),
                 plan = read_json(config / "plans/bench.json");
  world["scene"] = (config / "scenes/door").string();
  shrink(0.625, &world["cameras"][0]);
  shrink(0.25, &world["projectors"][0]);
  plan["world"] = "world.json";
  plan["board"] = "charuco:8x6:55mm";
  EXPECT_TRUE(write_file(folder / "world.json", world.dump(2)).ok());
  EXPECT_TRUE(write_file(folder / "plan.json", plan.dump(2)).ok());
  return folder / "plan.json";
}

}  // namespace limn::test
