#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/pose.h"

namespace limn::test {

/// The JSON of a file; comments are ignored. A file that is missing or broken fails the test and gives null.
nlohmann::json read_json(const std::filesystem::path& path);

/// Writes a JSON file and returns its path. A file that cannot be written fails the test.
std::filesystem::path write_json(const std::filesystem::path& path, const nlohmann::json& content);

/// The pose that to_json() of core/config.h wrote.
Pose pose_of(const nlohmann::json& json);

}  // namespace limn::test
