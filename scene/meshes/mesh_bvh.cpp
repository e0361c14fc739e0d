#include "scene/meshes/mesh_bvh.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/result.h"

namespace limn::scene {
namespace {

// Barycentric coordinates of the point of triangle abc nearest to p. The case depends on which feature is
// nearest: a corner, an edge or the inside (Ericson, Real-Time Collision Detection, 5.1.5).
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

constexpr std::uint32_t k_leaf =
    4;  // triangles per leaf; fewer cost more in boxes than they save in triangle tests

Eigen::Vector3d corner_of(const Mesh& mesh, std::size_t triangle, std::size_t corner) {
  return mesh.positions[mesh.triangles[triangle][corner]].cast<double>();
}

Eigen::Vector3d normal_at(const Mesh& mesh, std::size_t triangle, const Eigen::Vector3d& weights) {
  const auto& [i, j, k] = mesh.triangles[triangle];
  const Eigen::Vector3f normal = static_cast<float>(weights[0]) * mesh.normals[i] +
                                 static_cast<float>(weights[1]) * mesh.normals[j] +
                                 static_cast<float>(weights[2]) * mesh.normals[k];
  return normal.cast<double>().normalized();
}

double squared_distance(const Eigen::Vector3f& low, const Eigen::Vector3f& high, const Eigen::Vector3d& p) {
  return (low.cast<double>() - p).cwiseMax(p - high.cast<double>()).cwiseMax(0).squaredNorm();
}

}  // namespace

MeshPoint nearest_on(const Mesh& mesh, const Eigen::Vector3d& p) {
  return most_likely_on(mesh, p, Eigen::Matrix3d::Identity());
}

MeshPoint most_likely_on(const Mesh& mesh, const Eigen::Vector3d& p, const Eigen::Matrix3d& covariance) {
  LIMN_CHECK(!mesh.triangles.empty());
  const Eigen::LLT<Eigen::Matrix3d> root(covariance);
  LIMN_CHECK(root.info() == Eigen::Success);
  // In whitened coordinates with p as the origin the most likely point is the nearest one, and barycentric
  // coordinates do not change.
  const Eigen::Matrix3d whitened = root.matrixL().solve(Eigen::Matrix3d::Identity());
  std::vector<Eigen::Vector3d> places;
  places.reserve(mesh.positions.size());
  for (const Eigen::Vector3f& position : mesh.positions)
    places.emplace_back(whitened * (position.cast<double>() - p));
  MeshPoint found;
  Eigen::Vector3d weights = {1, 0, 0};
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [i, j, k] = mesh.triangles[t];
    const Eigen::Vector3d &a = places[i], &b = places[j], &c = places[k];
    const Eigen::Vector3d here = nearest_in_triangle(a, b, c, Eigen::Vector3d::Zero());
    const double distance = (here[0] * a + here[1] * b + here[2] * c).squaredNorm();
    if (!(distance < best)) continue;
    best = distance;
    weights = here;
    found.triangle = t;
  }
  for (std::size_t corner = 0; corner < 3; ++corner)
    found.p += weights[static_cast<Eigen::Index>(corner)] * corner_of(mesh, found.triangle, corner);
  found.d_normal = normal_at(mesh, found.triangle, weights);
  found.distance = (found.p - p).norm();
  return found;
}

MeshBvh::MeshBvh(const Mesh& mesh) : mesh_(mesh), order_(mesh.triangles.size()) {
  LIMN_CHECK(!mesh.triangles.empty());
  std::iota(order_.begin(), order_.end(), 0U);
  for (std::size_t t = 0; t < order_.size(); ++t) {
    const Eigen::Vector3d a = corner_of(mesh, t, 0), b = corner_of(mesh, t, 1), c = corner_of(mesh, t, 2);
    centres_.push_back(((a + b + c) / 3).cast<float>());
    d_faces_.push_back((b - a).cross(c - a).normalized().cast<float>());
  }
  boxes_.reserve(2 * order_.size() / k_leaf + 2);
  build(0, static_cast<std::uint32_t>(order_.size()));
}

// Splits at the median of the centres along the longest side; the first child directly follows its parent.
std::uint32_t MeshBvh::build(std::uint32_t first, std::uint32_t count) {
  const auto at = static_cast<std::uint32_t>(boxes_.size());
  Box box;
  box.low.setConstant(std::numeric_limits<float>::infinity());
  box.high = -box.low;
  box.first = first;
  box.count = count;
  box.d_mean.setZero();
  for (std::uint32_t i = first; i < first + count; ++i) {
    box.d_mean += d_faces_[order_[i]];
    for (const std::uint32_t corner : mesh_.triangles[order_[i]]) {
      box.low = box.low.cwiseMin(mesh_.positions[corner]);
      box.high = box.high.cwiseMax(mesh_.positions[corner]);
    }
  }
  box.d_mean.normalize();
  for (std::uint32_t i = first; i < first + count; ++i)
    box.cos_widest = std::min(box.cos_widest, box.d_mean.dot(d_faces_[order_[i]]));
  box.cos_widest = std::max(-1.f, box.cos_widest - 1e-5f);  // margin, so that rounding excludes no triangle
  box.sin_widest = std::sqrt(1 - box.cos_widest * box.cos_widest);
  boxes_.push_back(box);
  if (count <= k_leaf) return at;
  Eigen::Index axis = 0;
  (box.high - box.low).maxCoeff(&axis);
  const auto begin = order_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count, [&](std::uint32_t a, std::uint32_t b) {
    return centres_[a][axis] != centres_[b][axis] ? centres_[a][axis] < centres_[b][axis] : a < b;
  });
  build(first, count / 2);
  const std::uint32_t second = build(first + count / 2, count - count / 2);
  boxes_[at].first = second;
  boxes_[at].count = 0;
  return at;
}

std::optional<MeshPoint> MeshBvh::nearest(const Eigen::Vector3d& p,
                                          double max_distance,
                                          const Eigen::Vector3d* d_facing,
                                          double min_cos) const {
  double best = max_distance * max_distance;
  std::optional<MeshPoint> found;
  Eigen::Vector3d weights = {1, 0, 0};
  const double min_sin = std::sqrt(std::max(0.0, 1 - min_cos * min_cos));
  std::uint32_t stack[64];  // enough: the tree's depth is the logarithm of the number of triangles
  int depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const std::uint32_t at = stack[--depth];
    const Box& box = boxes_[at];
    if (squared_distance(box.low, box.high, p) > best) continue;
    if (d_facing) {  // compares the sum of two angles; if it is beyond 180 degrees, nothing is excluded
      const double cos_a = box.cos_widest, sin_a = box.sin_widest;
      const bool beyond = sin_a * min_cos + cos_a * min_sin < 0;
      if (!beyond && box.d_mean.cast<double>().dot(*d_facing) < cos_a * min_cos - sin_a * min_sin) continue;
    }
    if (box.count == 0) {
      const Box &a = boxes_[at + 1], &b = boxes_[box.first];
      const bool a_nearer = squared_distance(a.low, a.high, p) <= squared_distance(b.low, b.high, p);
      stack[depth++] = a_nearer ? box.first : at + 1;
      stack[depth++] = a_nearer ? at + 1 : box.first;
      continue;
    }
    for (std::uint32_t i = box.first; i < box.first + box.count; ++i) {
      const std::size_t t = order_[i];
      if (d_facing && d_faces_[t].cast<double>().dot(*d_facing) < min_cos) continue;
      const Eigen::Vector3d a = corner_of(mesh_, t, 0), b = corner_of(mesh_, t, 1),
                            c = corner_of(mesh_, t, 2);
      const Eigen::Vector3d here = nearest_in_triangle(a, b, c, p);
      const Eigen::Vector3d p_here = here[0] * a + here[1] * b + here[2] * c;
      const double distance = (p_here - p).squaredNorm();
      if (distance > best || (found && distance == best)) continue;
      best = distance;
      weights = here;
      if (!found) found.emplace();
      found->p = p_here;
      found->triangle = t;
    }
  }
  if (!found) return found;
  found->d_normal = normal_at(mesh_, found->triangle, weights);
  found->distance = std::sqrt(best);
  return found;
}

}  // namespace limn::scene
