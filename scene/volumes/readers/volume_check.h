#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>

#include "core/result.h"
#include "scene/volumes/volume.h"

namespace limn::scene {

/// Takes millimetres of DICOM's patient frame (LPS: x left, y back, z head) or NIfTI's (RAS) to metres of the
/// part's frame.
Eigen::Affine3d part_from_lps_mm();
Eigen::Affine3d part_from_ras_mm();

/// Error: fewer than 2 voxels along an axis, or more than the limits.
Status check_volume_size(const std::string& where, const std::array<long, 3>& size);

/// Error: numbers that are not finite, or voxels without volume.
Status check_grid(const std::string& where, const Eigen::Affine3d& part_from_voxel);

/// Fills least, most and, unless the file stated it (width > 0), window from the values. Error: values that
/// are not finite.
Status complete_values(const std::string& where, GreyWindow stated, Volume* volume);

}  // namespace limn::scene
