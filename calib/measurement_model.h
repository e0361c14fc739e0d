#pragma once

#include <Eigen/Core>
#include <span>

#include "core/lens.h"
#include "core/pose.h"

namespace limn::calib {

/// The shape of a nearly flat board: two parabolas, as in mrcal, and a twist. Height (m, along the board's z)
/// of the sheet at (x, y): bend.x (1 - xr^2) + bend.y (1 - yr^2) + twist xr yr, where xr and yr run from -1
/// to 1 over the squares.
struct BoardShape {
  double width_m = 1;
  double height_m = 1;
  double twist_m = 0;
  double z(const Eigen::Vector2d& bend, double x, double y) const;
  /// (dz/dx, dz/dy)
  Eigen::Vector2d slope(const Eigen::Vector2d& bend, double x, double y) const;
  /// (dz/dbend.x, dz/dbend.y)
  Eigen::Vector2d per_bend(double x, double y) const;
  /// dz/dtwist
  double per_twist(double x, double y) const;
};

/// An imager's parameters, borrowed from the caller.
struct ImagerView {
  const LensModel& model;
  std::span<const double> values;
  const Pose& imager_from_world;
};

/// Largest number of values of a lens model that can be solved (LENSMODEL_OPENCV12).
constexpr int k_most_values = 16;

/// The ray of an imager's pixel: the point (x, y, 1) on it, imager frame, and the derivatives of x and y by
/// the lens values at a fixed pixel (implicit function theorem: project(values, d) = px stays true, so
/// J_d dd = -J_values dvalues).
struct LensRay {
  Eigen::Vector3d d = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor, 2, k_most_values> xy_by_values;
};

/// Computes the LensRay of a pixel. The search starts from `ray` if that is not empty, and then takes two
/// steps when the values have hardly changed. False when the pixel has no ray (`ray` is then empty).
bool find_ray(const LensModel& model,
              std::span<const double> values,
              const Eigen::Vector2d& px,
              bool with_derivatives,
              LensRay* ray);

/// Derivatives of a predicted pixel. Poses: by the perturbation of boxplus, [rotation; translation]. Values:
/// 2 x value_count.
struct Derivatives {
  using Pose6 = Eigen::Matrix<double, 2, 6>;
  using Values = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor, 2, k_most_values>;
  Values camera_values, projector_values;
  Pose6 camera_pose, projector_pose, board_pose;
  Eigen::Matrix2d bend;
  Eigen::Vector2d twist;
  Eigen::Matrix2d board_xy;  ///< by the board's point, predict_corner() alone
};

/// Predicts the camera pixel of the board's point (x, y). False when it has none (behind the camera).
bool predict_corner(const ImagerView& camera,
                    const Pose& world_from_board,
                    const BoardShape& shape,
                    const Eigen::Vector2d& bend,
                    const Eigen::Vector2d& p_board_xy,
                    Eigen::Vector2d* px,
                    Derivatives* derivatives = nullptr);

/// Intersects the ray of a camera pixel with the board; gives the world point. False when they do not meet.
bool intersect_board(const ImagerView& camera,
                     const Pose& world_from_board,
                     const BoardShape& shape,
                     const Eigen::Vector2d& bend,
                     const Eigen::Vector2d& px_camera,
                     Eigen::Vector3d* p_world);

/// Predicts the projector pixel of that point.
bool predict_match(const ImagerView& camera,
                   const ImagerView& projector,
                   const Pose& world_from_board,
                   const BoardShape& shape,
                   const Eigen::Vector2d& bend,
                   const Eigen::Vector2d& px_camera,
                   Eigen::Vector2d* px_projector,
                   Derivatives* derivatives = nullptr);
/// The same with the ray of the camera pixel given (with its derivatives if `derivatives` is given).
bool predict_match(const ImagerView& camera,
                   const ImagerView& projector,
                   const Pose& world_from_board,
                   const BoardShape& shape,
                   const Eigen::Vector2d& bend,
                   const LensRay& ray,
                   Eigen::Vector2d* px_projector,
                   Derivatives* derivatives = nullptr);

/// Predicts where another imager (`seeing`) observes the tie point at depth 1 / `inverse_depth` along z of a
/// camera's ray.
struct TiePointDerivatives {
  Derivatives::Values camera_values, values;
  Derivatives::Pose6 camera_pose, pose;
  Eigen::Vector2d inverse_depth;
};
bool predict_tie_point(const ImagerView& camera,
                       const ImagerView& seeing,
                       const LensRay& ray,
                       double inverse_depth,
                       Eigen::Vector2d* px,
                       TiePointDerivatives* derivatives = nullptr);

/// Depth along a camera's `ray` (in units of its d) of the point nearest to the ray of another imager's
/// pixel; 0 when the rays are almost parallel or meet behind an imager.
double triangulated_depth(const ImagerView& camera,
                          const LensRay& ray,
                          const ImagerView& seeing,
                          const Eigen::Vector2d& px);

}  // namespace limn::calib
