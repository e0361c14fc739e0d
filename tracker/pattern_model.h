#pragma once

#include <Eigen/Core>
#include <array>

#include "tracker/pattern_fit.h"
#include "tracker/pattern_light.h"

/// What pattern_fit fits: the light of a code's pixels and its derivatives by all that is unknown.
namespace limn::tracker::pattern {

using Vector = Eigen::Matrix<double, k_unknowns, 1>;

/// One guess of it all; motion in pixels.
struct State {
  std::array<Eigen::Vector2d, 4> corners;
  double log_blur = 0;  // sigma, px
  Eigen::Vector2d motion = Eigen::Vector2d::Zero();
  Eigen::Vector3d paper = Eigen::Vector3d::Zero(), ink = Eigen::Vector3d::Zero();
  Eigen::Vector4d ground = Eigen::Vector4d::Zero(), margin = Eigen::Vector4d::Zero();
  Eigen::Vector4d bend = Eigen::Vector4d::Zero();
};

/// The same for pattern_light, whose pixels count from `origin`, near the marker.
Guess guess_of(const SeenCells& cells, const State& state, bool has_ground, const Eigen::Vector2d& origin);

}  // namespace limn::tracker::pattern
