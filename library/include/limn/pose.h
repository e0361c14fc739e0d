#pragma once

// Points, poses and their covariances.
#include <array>

#include "limn/export.h"

namespace limn::LIMN_VERSIONED {

/// Pixels: (0, 0) is the CENTRE of the top-left pixel; x right, y down.
using Point2 = std::array<double, 2>;
/// Metres, or a direction.
using Point3 = std::array<double, 3>;

/// Row by row. The covariance of a pose a_from_b is that of a small change (w, v): w (rad) is a rotation
/// about the axes of a, R' = Exp(w) R; v (m) is added to the translation. So the last three rows and
/// columns are the covariance of the position of b's origin in a.
using Covariance6 = std::array<double, 36>;

/// A rigid motion, named `a_from_b`: it takes coordinates in b to coordinates in a, p_a = a_from_b * p_b.
struct Pose {
  std::array<double, 4> rotation_wxyz = {1, 0, 0, 0};  ///< unit quaternion
  Point3 translation = {0, 0, 0};                      ///< m

  LIMN_API Point3 operator*(const Point3& p_b) const;
  /// a_from_c = a_from_b * b_from_c
  LIMN_API Pose operator*(const Pose& b_from_c) const;
  /// b_from_a
  LIMN_API Pose inverse() const;
  /// 4 x 4, row by row, for column vectors.
  LIMN_API std::array<double, 16> matrix() const;
  /// Error: the upper left 3 x 3 is no rotation within 1e-6, or the last row is not 0 0 0 1.
  LIMN_API static Pose from_matrix(const std::array<double, 16>& rows);

  bool operator==(const Pose&) const = default;
};

/// camera_from_world of a camera at `p_eye` that looks at `p_target`, where `d_up` points up in its image as
/// far as possible. Frames of cameras and projectors: x right, y down, z forward.
LIMN_API Pose looking_at(const Point3& p_eye, const Point3& p_target, const Point3& d_up);

}  // namespace limn::LIMN_VERSIONED
