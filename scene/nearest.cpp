#include "scene/nearest.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "core/result.h"

namespace limn::scene {
namespace {

// Barycentric coordinates of the point of triangle abc nearest to p, by the region of the triangle that p
// faces: a corner, an edge or the inside (Ericson, Real-Time Collision Detection, 5.1.5).
Eigen::Vector3d nearest_in_triangle(const Eigen::Vector3d& a,
                                    const Eigen::Vector3d& b,
                                    const Eigen::Vector3d& c,
                                    const Eigen::Vector3d& p) {
  const Eigen::Vector3d ab = b - a, ac = c - a;
  const double a_along_ab = ab.dot(p - a), a_along_ac = ac.dot(p - a);
  if (a_along_ab <= 0 && a_along_ac <= 0) return {1, 0, 0};
  const double b_along_ab = ab.dot(p - b), b_along_ac = ac.dot(p - b);
  if (b_along_ab >= 0 && b_along_ac <= b_along_ab) return {0, 1, 0};
  const double c_along_ab = ab.dot(p - c), c_along_ac = ac.dot(p - c);
  if (c_along_ac >= 0 && c_along_ab <= c_along_ac) return {0, 0, 1};

  const double beyond_ab = a_along_ab * b_along_ac - b_along_ab * a_along_ac;
  if (beyond_ab <= 0 && a_along_ab >= 0 && b_along_ab <= 0) {
    const double t = a_along_ab / (a_along_ab - b_along_ab);
    return {1 - t, t, 0};
  }
  const double beyond_ac = c_along_ab * a_along_ac - a_along_ab * c_along_ac;
  if (beyond_ac <= 0 && a_along_ac >= 0 && c_along_ac <= 0) {
    const double t = a_along_ac / (a_along_ac - c_along_ac);
    return {1 - t, 0, t};
  }
  const double beyond_bc = b_along_ab * c_along_ac - c_along_ab * b_along_ac;
  const double from_b = b_along_ac - b_along_ab, from_c = c_along_ab - c_along_ac;
  if (beyond_bc <= 0 && from_b >= 0 && from_c >= 0) {
    const double t = from_b / (from_b + from_c);
    return {0, 1 - t, t};
  }
  return Eigen::Vector3d(beyond_bc, beyond_ac, beyond_ab) / (beyond_ab + beyond_ac + beyond_bc);
}

}  // namespace

SurfacePoint nearest_on(const Mesh& mesh, const Eigen::Vector3d& p) {
  LIMN_CHECK(!mesh.triangles.empty());
  const auto position = [&](std::uint32_t corner) {
    return Eigen::Vector3d(mesh.positions[corner].cast<double>());
  };
  SurfacePoint found;
  Eigen::Vector3d weights = {1, 0, 0};
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [i, j, k] = mesh.triangles[t];
    const Eigen::Vector3d a = position(i), b = position(j), c = position(k);
    const Eigen::Vector3d here = nearest_in_triangle(a, b, c, p);
    const Eigen::Vector3d p_here = here[0] * a + here[1] * b + here[2] * c;
    const double distance = (p_here - p).squaredNorm();
    if (!(distance < best)) continue;
    best = distance;
    weights = here;
    found.p = p_here;
    found.triangle = t;
  }
  const auto& [i, j, k] = mesh.triangles[found.triangle];
  const Eigen::Vector3f normal = static_cast<float>(weights[0]) * mesh.normals[i] +
                                 static_cast<float>(weights[1]) * mesh.normals[j] +
                                 static_cast<float>(weights[2]) * mesh.normals[k];
  found.d_normal = normal.cast<double>().normalized();
  found.distance = std::sqrt(best);
  return found;
}

}  // namespace limn::scene
