#pragma once

#include <filesystem>
#include <vector>

#include "core/result.h"
#include "tracker/balls/ball_finder.h"

namespace limn::apps {

struct DetectBallsOptions {
  std::vector<std::filesystem::path> images;
  std::filesystem::path camera;                       ///< Any file that load_imager reads.
  std::vector<std::filesystem::path> constellations;  ///< limn.constellation/1
  tracker::BallShade shade = tracker::BallShade::bright;
  tracker::Encoding encoding = tracker::Encoding::linear;
  std::filesystem::path json;  ///< File to write; empty: none.
};

/// Finds balls and constellations in images, each on its own, prints a line for each constellation with its
/// pose (and one for each further pose that three balls leave possible), and writes the JSON file if asked
/// for. An image that cannot be read is reported; the others are still processed, and the status is an error.
Status run_detect_balls(const DetectBallsOptions& options);

}  // namespace limn::apps
