#pragma once

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/worlds.h"

namespace limn::session {

using test::copy_studio_to;
using test::read_json;
using test::studio_world;
using test::write_json;

inline constexpr const char* k_mirror = "aruco_4x4_50:0";  // the marker of the door's slot

inline nlohmann::json script_of(double seconds, const nlohmann::json& events) {
  return {{"schema", "limn.script/1"}, {"seconds", seconds}, {"events", events}};
}

inline std::vector<std::string> lines_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

}  // namespace limn::session
