#include "core/pose.h"

#include <cmath>

namespace limn {

Pose Pose::operator*(const Pose& b_from_c) const {
  return {rotation * b_from_c.rotation, rotation * b_from_c.translation + translation};
}

Pose Pose::inverse() const {
  const Eigen::Quaterniond b_from_a = rotation.conjugate();
  return {b_from_a, -(b_from_a * translation)};
}

Eigen::Matrix4d Pose::matrix() const {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = rotation_matrix();
  m.topRightCorner<3, 1>() = translation;
  return m;
}

bool Pose::is_finite() const { return rotation.coeffs().allFinite() && translation.allFinite(); }

Eigen::Quaterniond exp_rotation(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  // sin(angle / 2) / angle, by its series where the quotient loses precision
  const double scale = angle < 1e-4 ? 0.5 - angle * angle / 48 : std::sin(angle / 2) / angle;
  return Eigen::Quaterniond(std::cos(angle / 2), scale * w.x(), scale * w.y(), scale * w.z());
}

Eigen::Vector3d log_rotation(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0 ? -1 : 1;
  const double sine = q.vec().norm();
  const double half_angle = std::atan2(sine, sign * q.w());
  const double scale = sine < 1e-8 ? 2 : 2 * half_angle / sine;
  return sign * scale * q.vec();
}

Pose boxplus(const Pose& a_from_b, const Vector6d& delta) {
  return {exp_rotation(delta.head<3>()) * a_from_b.rotation, a_from_b.translation + delta.tail<3>()};
}

Vector6d boxminus(const Pose& to, const Pose& from) {
  Vector6d delta;
  delta << log_rotation(to.rotation * from.rotation.conjugate()), to.translation - from.translation;
  return delta;
}

Pose interpolated(const Pose& from, const Pose& to, double t) {
  return boxplus(from, t * boxminus(to, from));
}

bool is_same(const Pose& a, const Pose& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return log_rotation(a * b.conjugate()).norm();
}

Pose looking_at(const Eigen::Vector3d& p_eye, const Eigen::Vector3d& p_target, const Eigen::Vector3d& d_up) {
  const Eigen::Vector3d z = (p_target - p_eye).normalized();
  const Eigen::Vector3d x = z.cross(d_up).normalized();
  Eigen::Matrix3d camera_from_world;
  camera_from_world << x.transpose(), z.cross(x).transpose(), z.transpose();
  return {camera_from_world, -(camera_from_world * p_eye)};
}

}  // namespace limn
