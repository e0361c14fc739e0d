#include "tracker/balls/three_point_pose.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>

#include "core/linear_algebra.h"

namespace limn::tracker {
namespace {

// Roots with a larger imaginary part are no merged pair.
constexpr double k_most_imaginary = 0.05;
constexpr double k_least_leading = 1e-14;
// Smallest area of the triangle, as share of its longest side squared.
constexpr double k_least_area = 1e-3;
constexpr int k_polish_steps = 3;

// Real parts of the (nearly) real roots of c4 x^4 + ... + c0.
std::vector<double> real_roots(const std::array<double, 5>& c) {
  const double largest = std::abs(
      *std::max_element(c.begin(), c.end(), [](double a, double b) { return std::abs(a) < std::abs(b); }));
  std::vector<double> roots;
  if (!(std::abs(c[4]) > k_least_leading * largest)) return roots;
  Eigen::Matrix4d companion = Eigen::Matrix4d::Zero();
  for (int i = 0; i < 4; ++i) companion(i, 3) = -c[static_cast<std::size_t>(i)] / c[4];
  for (int i = 1; i < 4; ++i) companion(i, i - 1) = 1;
  const Eigen::EigenSolver<Eigen::Matrix4d> solver(companion, false);
  if (solver.info() != Eigen::Success) return roots;
  for (const std::complex<double>& root : solver.eigenvalues())
    if (std::abs(root.imag()) < k_most_imaginary) roots.push_back(root.real());
  return roots;
}

// Squared sides opposite to each point, and cosines of the angles between the rays to the other two.
struct Triangle {
  double a2, b2, c2;
  double cos_a, cos_b, cos_c;
};

// Newton's method on the three sides: distances s along the rays.
void polish(const Triangle& t, Eigen::Vector3d* s) {
  for (int step = 0; step < k_polish_steps; ++step) {
    const double x = (*s)[0], y = (*s)[1], z = (*s)[2];
    const Eigen::Vector3d off(y * y + z * z - 2 * y * z * t.cos_a - t.a2,
                              x * x + z * z - 2 * x * z * t.cos_b - t.b2,
                              x * x + y * y - 2 * x * y * t.cos_c - t.c2);
    Eigen::Matrix3d by;
    by << 0, 2 * (y - z * t.cos_a), 2 * (z - y * t.cos_a),  //
        2 * (x - z * t.cos_b), 0, 2 * (z - x * t.cos_b),    //
        2 * (x - y * t.cos_c), 2 * (y - x * t.cos_c), 0;
    const Eigen::Vector3d delta = by.fullPivLu().solve(off);
    // Near merged solutions Newton's steps are wild; the start is good to be refined on the pixels.
    if (!delta.allFinite() || !(delta.norm() < 0.02 * s->norm())) return;
    *s -= delta;
  }
}

// Grunert's polynomial in the ratio of the third distance to the first (Haralick et al., equation 9).
std::array<double, 5> polynomial(const Triangle& t) {
  const double p = (t.a2 - t.c2) / t.b2, q = (t.a2 + t.c2) / t.b2, c_b = t.c2 / t.b2, a_b = t.a2 / t.b2;
  const double ca = t.cos_a, cb = t.cos_b, cc = t.cos_c;
  return {(1 + p) * (1 + p) - 4 * a_b * cc * cc,
          4 * (-p * (1 + p) * cb + 2 * a_b * cc * cc * cb - (1 - q) * ca * cc),
          2 * (p * p - 1 + 2 * p * p * cb * cb + 2 * (1 - c_b) * ca * ca - 4 * q * ca * cb * cc +
               2 * (1 - a_b) * cc * cc),
          4 * (p * (1 - p) * cb - (1 - q) * ca * cc + 2 * c_b * ca * ca * cb),
          (p - 1) * (p - 1) - 4 * c_b * ca * ca};
}

}  // namespace

std::vector<Pose> three_point_poses(const std::array<Eigen::Vector3d, 3>& p_body,
                                    const std::array<Eigen::Vector3d, 3>& d_camera) {
  const Eigen::Vector3d a = p_body[2] - p_body[1], b = p_body[2] - p_body[0], c = p_body[1] - p_body[0];
  const Triangle t = {a.squaredNorm(),
                      b.squaredNorm(),
                      c.squaredNorm(),
                      d_camera[1].dot(d_camera[2]),
                      d_camera[0].dot(d_camera[2]),
                      d_camera[0].dot(d_camera[1])};
  std::vector<Pose> poses;
  if (!(b.cross(c).norm() > k_least_area * std::max({t.a2, t.b2, t.c2}))) return poses;
  const double p = (t.a2 - t.c2) / t.b2;
  for (const double v : real_roots(polynomial(t))) {
    const double below = 2 * (t.cos_c - v * t.cos_a), square = 1 + v * v - 2 * v * t.cos_b;
    if (!(std::abs(below) > 1e-12) || !(square > 0)) continue;
    const double u = ((p - 1) * v * v - 2 * p * t.cos_b * v + 1 + p) / below,
                 first = std::sqrt(t.b2 / square);
    Eigen::Vector3d s(first, u * first, v * first);
    if (!s.allFinite() || !(s.minCoeff() > 0)) continue;
    polish(t, &s);
    if (!(s.minCoeff() > 0)) continue;
    const std::array<Eigen::Vector3d, 3> p_camera = {s[0] * d_camera[0], s[1] * d_camera[1],
                                                     s[2] * d_camera[2]};
    const Pose pose = aligned(p_camera, p_body);
    if (pose.is_finite()) poses.push_back(pose);
  }
  return poses;
}

}  // namespace limn::tracker
