#include "scene/nearest.h"

#include <Eigen/Geometry>
#include <limits>

#include "core/result.h"

namespace limn::scene {
namespace {

// Barycentric coordinates of the point of triangle abc nearest to p, by the region of the triangle that p
// faces: a corner, an edge or the inside (Ericson, Real-Time Collision Detection, 5.1.5).
Eigen::Vector3f nearest_in_triangle(const Eigen::Vector3f& a,
                                    const Eigen::Vector3f& b,
                                    const Eigen::Vector3f& c,
                                    const Eigen::Vector3f& p) {
  const Eigen::Vector3f ab = b - a, ac = c - a;
  const float a_along_ab = ab.dot(p - a), a_along_ac = ac.dot(p - a);
  if (a_along_ab <= 0 && a_along_ac <= 0) return {1, 0, 0};
  const float b_along_ab = ab.dot(p - b), b_along_ac = ac.dot(p - b);
  if (b_along_ab >= 0 && b_along_ac <= b_along_ab) return {0, 1, 0};
  const float c_along_ab = ab.dot(p - c), c_along_ac = ac.dot(p - c);
  if (c_along_ac >= 0 && c_along_ab <= c_along_ac) return {0, 0, 1};

  const float beyond_ab = a_along_ab * b_along_ac - b_along_ab * a_along_ac;
  if (beyond_ab <= 0 && a_along_ab >= 0 && b_along_ab <= 0) {
    const float t = a_along_ab / (a_along_ab - b_along_ab);
    return {1 - t, t, 0};
  }
  const float beyond_ac = c_along_ab * a_along_ac - a_along_ab * c_along_ac;
  if (beyond_ac <= 0 && a_along_ac >= 0 && c_along_ac <= 0) {
    const float t = a_along_ac / (a_along_ac - c_along_ac);
    return {1 - t, 0, t};
  }
  const float beyond_bc = b_along_ab * c_along_ac - c_along_ab * b_along_ac;
  const float from_b = b_along_ac - b_along_ab, from_c = c_along_ab - c_along_ac;
  if (beyond_bc <= 0 && from_b >= 0 && from_c >= 0) {
    const float t = from_b / (from_b + from_c);
    return {0, 1 - t, t};
  }
  return Eigen::Vector3f(beyond_bc, beyond_ac, beyond_ab) / (beyond_ab + beyond_ac + beyond_bc);
}

}  // namespace

SurfacePoint nearest_on(const Mesh& mesh, const Eigen::Vector3d& p) {
  LIMN_CHECK(!mesh.triangles.empty());
  const Eigen::Vector3f p_asked = p.cast<float>();
  float best = std::numeric_limits<float>::infinity();
  Eigen::Vector3f best_weights = {1, 0, 0};
  SurfacePoint found;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [i, j, k] = mesh.triangles[t];
    const Eigen::Vector3f &a = mesh.positions[i], &b = mesh.positions[j], &c = mesh.positions[k];
    const Eigen::Vector3f weights = nearest_in_triangle(a, b, c, p_asked);
    const float distance = (weights[0] * a + weights[1] * b + weights[2] * c - p_asked).squaredNorm();
    if (!(distance < best)) continue;
    best = distance;
    best_weights = weights;
    found.triangle = t;
  }
  const auto& corners = mesh.triangles[found.triangle];
  found.p.setZero();
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  for (int k = 0; k < 3; ++k) {
    found.p += static_cast<double>(best_weights[k]) * mesh.positions[corners[k]].cast<double>();
    normal += best_weights[k] * mesh.normals[corners[k]];
  }
  found.d_normal = normal.cast<double>().normalized();
  found.distance = (found.p - p).norm();
  return found;
}

}  // namespace limn::scene
