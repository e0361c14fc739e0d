#pragma once

#include <Eigen/Dense>
#include <nlohmann/json.hpp>
#include <random>
#include <vector>

#include "core/pose.h"

namespace limn::test {

/// Between an eye, which looks along -z with y up as in WebXR, and an imager.
inline Pose turned() { return {Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero()}; }

/// [rotation; translation] with these standard deviations.
Vector6d noise(std::mt19937_64& rng, double rotation, double translation);

/// A person with glasses, whose odometry drifts by 0.02 degrees and 0.3 mm in a second: where the eye is in
/// truth, and by the odometry, at steps of time.
struct Walk {
  std::vector<Pose> world_from_eye, feed_from_eye;

  Pose eye(double at_s) const;
};

/// Looks round, then stands at each of three stations in turn. `look`: how far the head turns; 1: 32 degrees.
Walk walk_through(const Eigen::Vector3d& p_middle, double look, std::mt19937_64& rng);

/// What the page's odometry needs to know of a walk, and its times.
nlohmann::json path_of(const Walk& walk);

}  // namespace limn::test
