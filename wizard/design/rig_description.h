#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "calib/board/board.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::design {

/// A rig before it is bought, as a limn.described/1 file describes it (config/README.md).
struct DescribedRig {
  Rig rig;  ///< lenses without distortion; world: metres, z up
  Eigen::Vector3d p_centre = Eigen::Vector3d::Zero(), size_m = Eigen::Vector3d::Zero();  ///< working volume
  Eigen::Vector3d d_front = -Eigen::Vector3d::UnitY();  ///< normal of the prototype's lit side
  double room_lux = 0;         ///< illuminance of that side by other light; 0: not known
  std::vector<double> lumens;  ///< luminous flux of each projector; 0: not known
  calib::Board board;
  int poses = 12;           ///< number of board poses
  double corner_px = 0.08;  ///< standard deviation of a board corner's coordinate in a camera's image
  double match_px = 0.05;   ///< standard deviation of a match's coordinate in a projector's image
  double marker_m = 0.04;   ///< side of a marker
  double marker_px = 0.1;   ///< standard deviation of a marker corner's coordinate in a camera's image
};

/// Reads a limn.described/1 file. Errors name the file and the key.
Result<DescribedRig> load_described(const std::filesystem::path& path);

}  // namespace limn::design
