#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "scene/meshes/mesh.h"

namespace limn::scene {

/// A point on a mesh, in the mesh's frame (m).
struct MeshPoint {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Vector3d d_normal = Eigen::Vector3d::UnitZ();  ///< Unit normal, interpolated from the corners.
  std::size_t triangle = 0;
  double distance = 0;  ///< Euclidean distance from the query point.
};

/// The point of the mesh nearest to p, by a search of all triangles. The mesh must have at least one.
MeshPoint nearest_on(const Mesh& mesh, const Eigen::Vector3d& p);

/// The most likely point on the mesh for a point that was measured at p with a Gaussian error: the nearest by
/// Mahalanobis distance, which minimises (x - p)^T covariance^-1 (x - p). `distance` is the Euclidean one.
/// The covariance must be positive definite.
MeshPoint most_likely_on(const Mesh& mesh, const Eigen::Vector3d& p, const Eigen::Matrix3d& covariance);

/// A bounding-volume tree over a mesh's triangles, for many nearest-point queries. It refers to the mesh,
/// which must outlive it and must not change. Several threads may query at once.
class MeshBvh {
 public:
  explicit MeshBvh(const Mesh& mesh);

  /// The nearest point within `max_distance` (m); nullopt when there is none. With `d_facing`, only triangles
  /// that face the same way count: geometric normal . d_facing >= min_cos. So the back of a thin object is
  /// not mistaken for its front.
  std::optional<MeshPoint> nearest(const Eigen::Vector3d& p,
                                   double max_distance,
                                   const Eigen::Vector3d* d_facing = nullptr,
                                   double min_cos = 0.5) const;

 private:
  struct Box {
    Eigen::Vector3f low, high;
    // A leaf's triangles are order_[first] and the next ones. Count 0: an inner box with second child
    // `first`.
    std::uint32_t first = 0, count = 0;
    Eigen::Vector3f d_mean;                // mean of the triangles' normals
    float cos_widest = 1, sin_widest = 0;  // largest angle between a triangle's normal and d_mean
  };
  std::uint32_t build(std::uint32_t first, std::uint32_t count);

  const Mesh& mesh_;
  std::vector<std::uint32_t> order_;
  std::vector<Eigen::Vector3f> centres_, d_faces_;
  std::vector<Box> boxes_;
};

}  // namespace limn::scene
