#pragma once

#include <Eigen/Core>

#include "scene/volumes/volume.h"

namespace limn::sim {

/// The value of a volume at a point of the part's frame: trilinear between the centres of voxels, and that of
/// the nearest centres outside of them.
double value_at(const scene::Volume& volume, const Eigen::Vector3d& p_part);

/// The linear light, 0 … 1, with which a slice shows this point: grey by the window, which is sRGB.
double slice_light(const scene::Volume& volume,
                   const scene::GreyWindow& window,
                   const Eigen::Vector3d& p_part);

}  // namespace limn::sim
