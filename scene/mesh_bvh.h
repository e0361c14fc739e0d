#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "scene/mesh.h"

namespace limn::scene {

/// A place on a mesh, in the mesh's frame (m).
struct MeshPoint {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Vector3d d_normal = Eigen::Vector3d::UnitZ();  ///< unit, interpolated from the corners' normals
  std::size_t triangle = 0;
  double distance = 0;  ///< from the point asked for
};

/// The point of the mesh nearest to p. Looks at every triangle. The mesh must have
/// one.
MeshPoint nearest_on(const Mesh& mesh, const Eigen::Vector3d& p);

/// The likeliest place on the mesh of a point that was measured at p with a Gaussian error: the nearest by
/// Mahalanobis' distance, (x - p)^T covariance^-1 (x - p) least. `distance` stays the ordinary one.
/// Covariance must be positive definite.
MeshPoint most_likely_on(const Mesh& mesh, const Eigen::Vector3d& p, const Eigen::Matrix3d& covariance);

/// The same question asked often: triangles in a tree of boxes. Borrows the mesh, which must outlive it
/// unchanged. Queries are safe from several threads.
class MeshBvh {
 public:
  explicit MeshBvh(const Mesh& mesh);

  /// The nearest point within `max_distance` (m); nullopt when there is none. With `d_facing` only on
  /// triangles that turn the same way: geometric normal . d_facing >= min_cos, so that a thin thing's back is
  /// not taken for its front.
  std::optional<MeshPoint> nearest(const Eigen::Vector3d& p,
                                   double max_distance,
                                   const Eigen::Vector3d* d_facing = nullptr,
                                   double min_cos = 0.5) const;

 private:
  struct Box {
    Eigen::Vector3f low, high;
    std::uint32_t first = 0, count = 0;    // of order_; count 0: an inner box, its second child is `first`
    Eigen::Vector3f d_mean;                // of its triangles' normals, which
    float cos_widest = 1, sin_widest = 0;  // turn from it by at most this angle
  };
  std::uint32_t build(std::uint32_t first, std::uint32_t count);

  const Mesh& mesh_;
  std::vector<std::uint32_t> order_;
  std::vector<Eigen::Vector3f> centres_, d_faces_;
  std::vector<Box> boxes_;
};

}  // namespace limn::scene
