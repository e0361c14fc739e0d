#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"
#include "tracker/balls/ball_finder.h"

namespace limn::apps {

struct LearnConstellationOptions {
  std::vector<std::filesystem::path> images;
  std::filesystem::path camera;
  double ball_mm = 40;  ///< Diameter of the balls.
  tracker::BallShade shade = tracker::BallShade::bright;
  tracker::Encoding encoding = tracker::Encoding::linear;
  std::vector<std::filesystem::path> others;  ///< Constellations that the learned one must differ from.
  std::filesystem::path out;                  ///< File to write (limn.constellation/1).
};

/// Measures from images of a rigid body where the balls on it are, and writes that as limn.constellation/1
/// (config/README.md). Nothing is written when the constellation is collinear, symmetric or like another one.
Status run_learn_constellation(const LearnConstellationOptions& options);

}  // namespace limn::apps
