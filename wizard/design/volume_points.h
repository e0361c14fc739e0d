#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "wizard/design/rig_description.h"

namespace limn::design {

/// A grid of points all over the working volume, world frame.
std::vector<Eigen::Vector3d> volume_points(const DescribedRig& described);

/// Share of the points for which `reached` returns true.
template <class Reached>
double share_reached(const std::vector<Eigen::Vector3d>& points, const Reached& reached) {
  return static_cast<double>(std::count_if(points.begin(), points.end(), reached)) /
         static_cast<double>(points.size());
}

}  // namespace limn::design
