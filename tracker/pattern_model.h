#pragma once

#include <Eigen/Core>
#include <array>

#include "tracker/pattern_appearance.h"
#include "tracker/pattern_kernels.h"

/// The model that pattern_fit fits: the light of a code's pixels and its derivatives by all unknowns.
namespace limn::tracker::pattern {

using Vector = Eigen::Matrix<double, k_unknowns, 1>;

/// One estimate of all unknowns.
struct State : Appearance {
  std::array<Eigen::Vector2d, 4> corners;
};

/// The same in the form that pattern_kernels uses; pixels are relative to `origin`, near the marker.
Guess guess_of(const SeenCells& cells, const State& state, bool has_ground, const Eigen::Vector2d& origin);

}  // namespace limn::tracker::pattern
