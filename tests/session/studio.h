#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/scale_resolution.h"
#include "sim/world.h"
#include "tracker/marker_image.h"

namespace limn::apps {

inline constexpr const char* k_mirror = "aruco_4x4_50:0";  // the marker of the door's slot

inline sim::World studio(double resolution) {
  sim::World world =
      sim::load_world(std::filesystem::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json", marker_image)
          .value();
  EXPECT_TRUE(scale_resolution(resolution, &world.rig).ok());
  return world;
}

inline nlohmann::json script_of(double seconds, const nlohmann::json& events) {
  return {{"schema", "limn.script/1"}, {"seconds", seconds}, {"events", events}};
}

inline std::filesystem::path written(const std::filesystem::path& path, const nlohmann::json& content) {
  EXPECT_TRUE(write_file(path, content.dump(2)));
  return path;
}

inline nlohmann::json read_json(const std::filesystem::path& path) {
  const auto text = read_file(path);
  return text ? nlohmann::json::parse(*text) : nlohmann::json();
}

inline std::vector<std::string> lines_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

// Copies the studio and its scene, so that they can be changed: world.json and door/.
inline void copy_studio_to(const std::filesystem::path& folder) {
  const std::filesystem::path config = std::filesystem::path(LIMN_SOURCE_DIR) / "config";
  std::filesystem::copy(config / "scenes/door", folder / "door");
  std::string world = read_file(config / "worlds/studio.json").value();
  const std::string named = "../scenes/door";
  world.replace(world.find(named), named.size(), "door");
  ASSERT_TRUE(write_file(folder / "world.json", world));
}

}  // namespace limn::apps
