#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "calib/board/board.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::apps {

/// A rig that is thought of, not bought: a limn.described/1 file (config/README.md).
struct DescribedRig {
  Rig rig;  ///< lenses without distortion; world: metres, z up
  Eigen::Vector3d p_centre = Eigen::Vector3d::Zero(), size_m = Eigen::Vector3d::Zero();  ///< working volume
  Eigen::Vector3d d_front = -Eigen::Vector3d::UnitY();  ///< where the prototype's lit side looks
  double room_lux = 0;                                  ///< other light on that side; 0: not known
  std::vector<double> lumens;                           ///< of each projector; 0: not known
  calib::Board board;
  int poses = 12;  ///< placements of the board
  double corner_px =
      0.08;  ///< noise of a board corner in a camera's image, standard deviation of a coordinate
  double match_px = 0.05;  ///< of a decoded place on a projector's panel
  double marker_m = 0.04;  ///< side of a designer's marker
  double marker_px = 0.1;  ///< noise of its corners
};

/// Errors name the file and the key.
Result<DescribedRig> load_described(const std::filesystem::path& path);

}  // namespace limn::apps
