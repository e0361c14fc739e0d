#pragma once

#include <Eigen/Core>
#include <array>

#include "tracker/pattern_appearance.h"
#include "tracker/pattern_kernels.h"

/// What pattern_fit fits: the light of a code's pixels and its derivatives by all that is unknown.
namespace limn::tracker::pattern {

using Vector = Eigen::Matrix<double, k_unknowns, 1>;

/// One guess of it all.
struct State : Appearance {
  std::array<Eigen::Vector2d, 4> corners;
};

/// The same for pattern_light, whose pixels count from `origin`, near the marker.
Guess guess_of(const SeenCells& cells, const State& state, bool has_ground, const Eigen::Vector2d& origin);

}  // namespace limn::tracker::pattern
