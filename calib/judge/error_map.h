#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/judge/uncertainty.h"
#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// Predicted error over the volume that the cameras and one projector share: on planes that face camera 0,
/// from near to far, each a grid of cells over camera 0's image. Where boards that other cameras see reach
/// beyond this image, the grid continues beyond it, over the boards' whole length. Places are shares of
/// camera 0's image, 0 to 1 across and down; the grid covers those from `low` to `high`. Of a grid that
/// continues, a place is that of camera 0's pinhole, without distortion.
struct ErrorMap {
  struct Plane {
    double depth_m = 0;          ///< along camera 0's axis
    std::vector<double> p95_mm;  ///< row by row; NaN where the projector does not reach or nothing is known
  };
  int projector = 0;
  Eigen::Vector2d low = {0, 0}, high = {1, 1};
  int columns = 0;
  int rows = 0;
  std::vector<Plane> planes;
  /// Largest finite value; 0 when there is none.
  double worst_mm() const;
  bool is_wider_than_image() const { return low != Eigen::Vector2d(0, 0) || high != Eigen::Vector2d(1, 1); }
  /// Centre of a cell; and the place of a point (m, camera 0's frame), none where the map has none.
  Eigen::Vector2d place_of_cell(int cell) const;
  std::optional<Eigen::Vector2d> place_of(const Imager& camera, const Eigen::Vector3d& p_camera) const;
  /// The point (m, camera 0's frame) at a place and depth; none where camera 0's lens does not see.
  std::optional<Eigen::Vector3d> point_at(const Imager& camera,
                                          const Eigen::Vector2d& place,
                                          double depth_m) const;
  /// Width and height of a plane, m.
  Eigen::Vector2d size_m(const Imager& camera, const Plane& plane) const;
  /// Interpolates between the centres of cells and planes, at a place and a depth. Outside the volume the
  /// nearest value is used. NaN where no neighbour is known.
  double at(const Eigen::Vector2d& place, double depth_m) const;
};

struct ErrorMapOptions {
  int columns = 16;      ///< cells across camera 0's image, beyond which they are as large
  int planes = 5;        ///< number of planes, from the nearest to the farthest point of the boards
  double beyond = 0.15;  ///< margin in front of and behind them, m: as far as the prototype may be moved
};

/// One map for each projector: 95 % error (mm) of light meant for the middle of a target as large as the
/// board that faces camera 0 at that place, and whose pose camera 0 measures, or the camera that sees more of
/// it.
std::vector<ErrorMap> error_maps(const Observations& observations,
                                 const Solution& solution,
                                 const Uncertainty& uncertainty,
                                 const ErrorMapOptions& options = {});

}  // namespace limn::calib
