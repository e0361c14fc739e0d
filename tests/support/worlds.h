#pragma once

#include <gtest/gtest.h>

#include <filesystem>

#include "core/scale_resolution.h"
#include "sim/world.h"
#include "tests/support/json.h"
#include "tracker/marker_image.h"

/// The example worlds of config/, and changed copies of them.
namespace limn::test {

inline std::filesystem::path config_folder() { return std::filesystem::path(LIMN_SOURCE_DIR) / "config"; }

/// A camera, a projector and the door on a bench.
inline sim::World bench_world() {
  return sim::load_world(config_folder() / "worlds/bench.json", tracker::marker_image).value();
}

/// A camera, two projectors and the door in a studio. Images have `resolution` times their width and height.
inline sim::World studio_world(double resolution = 1) {
  sim::World world = sim::load_world(config_folder() / "worlds/studio.json", tracker::marker_image).value();
  if (resolution != 1) {
    EXPECT_TRUE(scale_resolution(resolution, &world.rig).ok());
  }
  return world;
}

/// Copies the studio and its scene, so that they can be changed: world.json and door/.
inline void copy_studio_to(const std::filesystem::path& folder) {
  std::filesystem::copy(config_folder() / "scenes/door", folder / "door");
  nlohmann::json world = read_json(config_folder() / "worlds/studio.json");
  world["scene"] = "door";
  write_json(folder / "world.json", world);
}

/// The bench's world file without its prototype.
inline nlohmann::json empty_bench() {
  nlohmann::json world = read_json(config_folder() / "worlds/bench.json");
  for (const char* key : {"scene", "world_from_prototype", "slot_markers"}) world.erase(key);
  return world;
}

/// Scales the width and height of an imager in a world file by `share`; its field of view stays.
inline void shrink(double share, nlohmann::json* imager) {
  for (auto& side : (*imager)["size"]) side = static_cast<int>(share * side.get<int>());
  auto& values = (*imager)["lens"]["values"];
  for (std::size_t i = 0; i < 2; ++i) values[i] = share * values[i].get<double>();
  for (std::size_t i = 2; i < 4; ++i) values[i] = share * (values[i].get<double>() + 0.5) - 0.5;
}

}  // namespace limn::test
