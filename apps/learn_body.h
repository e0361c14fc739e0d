#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct LearnBodyOptions {
  std::vector<std::filesystem::path> images;
  std::filesystem::path camera;
  std::string family = "aruco_4x4_50";
  double size_mm = 40;
  std::filesystem::path out;  ///< Body file to write (limn.body/1).
};

/// Measures from images of a rigid body where its markers are on it, and writes that as limn.body/1
/// (config/README.md).
Status run_learn_body(const LearnBodyOptions& options);

}  // namespace limn::apps
