#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace limn {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// A rigid motion, named `a_from_b`: takes coordinates in b to coordinates in a, p_a = a_from_b * p_b.
/// Metres; the rotation is a unit quaternion.
struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Pose() = default;
  Pose(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) : rotation(q.normalized()), translation(t) {}
  Pose(const Eigen::Matrix3d& r, const Eigen::Vector3d& t) : Pose(Eigen::Quaterniond(r), t) {}

  Eigen::Vector3d operator*(const Eigen::Vector3d& p_b) const { return rotation * p_b + translation; }
  /// a_from_c = a_from_b * b_from_c
  Pose operator*(const Pose& b_from_c) const;
  /// b_from_a
  Pose inverse() const;
  Eigen::Matrix3d rotation_matrix() const { return rotation.toRotationMatrix(); }
  /// 4x4 homogeneous matrix, column vectors.
  Eigen::Matrix4d matrix() const;
  bool is_finite() const;
};

/// Rotation of angle |w| about the axis w (radians).
Eigen::Quaterniond exp_rotation(const Eigen::Vector3d& w);
/// Inverse of exp_rotation, |w| <= pi.
Eigen::Vector3d log_rotation(const Eigen::Quaterniond& q);

/// Left perturbation in the axes of a: delta = [w; v], R' = Exp(w) R, t' = t + v. Every 6x6 covariance in
/// Limn is the covariance of this delta; so its lower block is the covariance of the position of b's origin
/// in a. (docs/decisions/0002-pose-perturbation.md says why v is independent of the rotation.)
Pose boxplus(const Pose& a_from_b, const Vector6d& delta);
/// The delta for which boxplus(from, delta) == to.
Vector6d boxminus(const Pose& to, const Pose& from);

/// The pose between `from` (t = 0) and `to` (t = 1): the rotation takes the shortest arc, b's origin moves on
/// a straight line. t outside [0, 1] extrapolates.
Pose interpolated(const Pose& from, const Pose& to, double t);

/// Whether all numbers of both poses are equal.
bool is_same(const Pose& a, const Pose& b);

/// Angle between two orientations, radians in [0, pi].
double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

/// camera_from_world of an imager at `p_eye` that looks at `p_target` with its image's down direction as
/// close to -`d_up` as possible (x right, y down, z forward).
Pose looking_at(const Eigen::Vector3d& p_eye, const Eigen::Vector3d& p_target, const Eigen::Vector3d& d_up);

}  // namespace limn
