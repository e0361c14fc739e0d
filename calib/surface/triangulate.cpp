#include "calib/surface/triangulate.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace limn::calib {
namespace {

constexpr int k_most_steps = 8;      // two are enough from a midpoint
constexpr double k_settled = 1e-9;   // m; a thousandth of the movement by a pixel's noise
constexpr double k_parallel = 1e-6;  // sin² of 0.06 degrees

using Jacobian = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

// Residual and derivatives of one imager, in standard deviations.
bool ray_residual(const Imager& imager,
                  const MeasuredPixel& measured,
                  const Eigen::Vector3d& p_world,
                  Eigen::Vector2d* residual,
                  Jacobian* per_point) {
  Eigen::Vector2d px;
  Jacobian per_imager_point;
  const Eigen::Vector3d p = imager.imager_from_world * p_world;
  if (!imager.lens.model.project(imager.lens.values, p, &px, per_imager_point.data())) return false;
  const Eigen::Vector2d weight = measured.variance.cwiseSqrt().cwiseInverse();
  *residual = (px - measured.px).cwiseProduct(weight);
  *per_point = weight.asDiagonal() * (per_imager_point * imager.imager_from_world.rotation_matrix());
  return true;
}

Eigen::Vector3d towards(const Imager& imager, const Eigen::Vector3d& p_world) {
  const Eigen::Vector3d p_eye = imager.imager_from_world.inverse().translation;
  return (p_world - p_eye).normalized();
}

}  // namespace

std::optional<Eigen::Vector3d> midpoint(const Ray& a, const Ray& b) {
  const Eigen::Vector3d between = b.p_origin - a.p_origin;
  const double cosine = a.d.dot(b.d), sine2 = 1 - cosine * cosine;
  if (sine2 < k_parallel) return std::nullopt;
  const double along_a = (between.dot(a.d) - cosine * between.dot(b.d)) / sine2;
  const double along_b = (cosine * between.dot(a.d) - between.dot(b.d)) / sine2;
  if (!(along_a > 0 && along_b > 0)) return std::nullopt;
  return 0.5 * (a.p_origin + along_a * a.d + b.p_origin + along_b * b.d);
}

std::optional<Triangulated> triangulate(const Imager& a,
                                        const Imager& b,
                                        const MeasuredPixel& px_a,
                                        const MeasuredPixel& px_b,
                                        const Eigen::Vector3d& p_start) {
  Triangulated found;
  found.p_world = p_start;
  Eigen::Vector2d residual_a, residual_b;
  Jacobian j_a, j_b;
  for (int step = 0; step < k_most_steps; ++step) {
    if (!ray_residual(a, px_a, found.p_world, &residual_a, &j_a)) return std::nullopt;
    if (!ray_residual(b, px_b, found.p_world, &residual_b, &j_b)) return std::nullopt;
    const Eigen::Matrix3d information = j_a.transpose() * j_a + j_b.transpose() * j_b;
    const Eigen::LLT<Eigen::Matrix3d> factored(information);
    if (factored.info() != Eigen::Success) return std::nullopt;
    const Eigen::Vector3d move = -factored.solve(j_a.transpose() * residual_a + j_b.transpose() * residual_b);
    if (!move.allFinite()) return std::nullopt;
    found.p_world += move;
    if (move.norm() > k_settled) continue;
    found.covariance = factored.solve(Eigen::Matrix3d::Identity());
    const Eigen::Vector2d off_a = residual_a.cwiseProduct(px_a.variance.cwiseSqrt());
    const Eigen::Vector2d off_b = residual_b.cwiseProduct(px_b.variance.cwiseSqrt());
    found.epipolar_px = std::sqrt(off_a.squaredNorm() + off_b.squaredNorm());
    found.epipolar_sigmas = std::sqrt(residual_a.squaredNorm() + residual_b.squaredNorm());
    const Eigen::Vector2d along = j_b * towards(a, found.p_world);
    const double side = along.x() * residual_b.y() - along.y() * residual_b.x();
    found.epipolar_residual = std::copysign(found.epipolar_sigmas, side);
    found.angle = std::acos(std::clamp(towards(a, found.p_world).dot(towards(b, found.p_world)), -1.0, 1.0));
    return found;
  }
  return std::nullopt;
}

}  // namespace limn::calib
