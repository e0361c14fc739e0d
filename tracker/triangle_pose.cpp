#include "tracker/triangle_pose.h"

#include <Eigen/Dense>
#include <cmath>

#include "core/result.h"
#include "tracker/marker_pose.h"

namespace limn::tracker {
namespace {

// Below it the first terms of the series are exact in double precision.
constexpr double k_small_angle = 1e-6;

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// V of exp([w v]) = (Exp(w), V v): I + (1 - cos a)/a^2 [w]x + (a - sin a)/a^3 [w]x^2.
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& w) {
  const double a = w.norm();
  const double first = a < k_small_angle ? 0.5 : (1 - std::cos(a)) / (a * a);
  const double second = a < k_small_angle ? 1.0 / 6 : (a - std::sin(a)) / (a * a * a);
  return Eigen::Matrix3d::Identity() + first * skew(w) + second * skew(w) * skew(w);
}

Eigen::Vector3d origin_of(const Triangle& triangle, TriangleOrigin origin) {
  switch (origin) {
    case TriangleOrigin::vertex:
      return triangle[0];
    case TriangleOrigin::side_midpoint:
      return 0.5 * (triangle[0] + triangle[1]);
    case TriangleOrigin::centroid:
      break;
  }
  return (triangle[0] + triangle[1] + triangle[2]) / 3;
}

}  // namespace

std::optional<Pose> triangle_frame(const Triangle& triangle, const TriangleOptions& options) {
  LIMN_CHECK(options.first_axis >= 0 && options.first_axis < 3);
  const auto from = static_cast<std::size_t>(options.first_axis);
  const Eigen::Vector3d side = triangle[(from + 1) % 3] - triangle[from];
  const Eigen::Vector3d other = triangle[(from + 2) % 3] - triangle[from];
  Eigen::Vector3d normal = side.cross(other);
  if (!normal.allFinite() || !(normal.norm() > 1e-9 * side.norm() * other.norm())) return std::nullopt;
  if (options.flip_normal) normal = -normal;
  Eigen::Matrix3d axes;
  axes.col(0) = side.normalized();
  axes.col(2) = normal.normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return Pose(axes, origin_of(triangle, options.origin));
}

std::optional<Pose> pose_from_triangles(const Triangle& in_marker,
                                        const Triangle& in_camera,
                                        const TriangleOptions& options) {
  const auto a = triangle_frame(in_marker, options);
  const auto b = triangle_frame(in_camera, options);
  if (!a || !b) return std::nullopt;
  return *b * a->inverse();  // R = B A^-1
}

Eigen::Matrix4d twist(const Pose& motion) {
  const Eigen::Vector3d w = log_rotation(motion.rotation);
  Eigen::Matrix4d theta = Eigen::Matrix4d::Zero();
  theta.topLeftCorner<3, 3>() = skew(w);
  theta.topRightCorner<3, 1>() = left_jacobian(w).partialPivLu().solve(motion.translation);
  return theta;
}

Pose exp_twist(const Eigen::Matrix4d& theta) {
  const Eigen::Vector3d w(theta(2, 1), theta(0, 2), theta(1, 0));
  const Eigen::Vector3d v = theta.topRightCorner<3, 1>();
  return Pose(exp_rotation(w), left_jacobian(w) * v);
}

std::optional<std::array<Eigen::Vector3d, 4>> recovered_corners(
    const Lens& lens, double size_m, const std::array<Eigen::Vector2d, 4>& corners_px) {
  std::array<Eigen::Vector3d, 4> d;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto direction = corners_px[i].allFinite() ? lens.unproject(corners_px[i]) : std::nullopt;
    if (!direction) return std::nullopt;
    d[i] = *direction;
  }
  // Distances relative to that of corner 3: [d0 -d1 d2] (s0 s1 s2)' = d3.
  Eigen::Matrix3d a;
  a << d[0], -d[1], d[2];
  const Eigen::Vector3d s = a.fullPivLu().solve(d[3]);
  if (!s.allFinite() || !(s.minCoeff() > 0) || !(s.maxCoeff() < 1e6)) return std::nullopt;
  std::array<Eigen::Vector3d, 4> p = {s[0] * d[0], s[1] * d[1], s[2] * d[2], d[3]};
  double sides = 0;
  for (std::size_t i = 0; i < 4; ++i) sides += (p[(i + 1) % 4] - p[i]).norm();
  const double scale = 4 * size_m / sides;
  if (!std::isfinite(scale)) return std::nullopt;
  for (Eigen::Vector3d& corner : p) corner *= scale;
  return p;
}

std::optional<Pose> triangle_pose(const Lens& lens,
                                  double size_m,
                                  const std::array<Eigen::Vector2d, 4>& corners_px,
                                  const TriangleOptions& options,
                                  std::size_t omitted_corner) {
  LIMN_CHECK(omitted_corner < 4);
  const auto in_camera = recovered_corners(lens, size_m, corners_px);
  if (!in_camera) return std::nullopt;
  const auto in_marker = square_corners(size_m);
  Triangle marker_triangle;
  Triangle camera_triangle;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t corner = (omitted_corner + 1 + i) % 4;
    marker_triangle[i] = in_marker[corner];
    camera_triangle[i] = (*in_camera)[corner];
  }
  return pose_from_triangles(marker_triangle, camera_triangle, options);
}

}  // namespace limn::tracker
