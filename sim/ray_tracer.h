#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/result.h"

namespace limn::sim {

/// Where a ray first hits a triangle, as Embree says it.
struct TracedHit {
  int mesh = -1;  ///< -1: nothing.
  int triangle = -1;
  float u = 0, v = 0;  ///< Weights of the triangle's second and third corner.
  float distance = 0;
};

/// Queries of rays by Embree. Its implementation is in a shared library of its own (sim/embree/), which would
/// lengthen every start of the program. Queries are thread-safe.
class RayTracer {
 public:
  virtual ~RayTracer() = default;

  /// Adds a mesh; meshes count from 0. The arrays must outlive this object. Embree may read 4 bytes beyond
  /// `positions`.
  virtual void add_mesh(std::span<const Eigen::Vector3f> positions,
                        std::span<const std::array<std::uint32_t, 3>> triangles) = 0;
  /// The positions of a mesh have changed.
  virtual void update_mesh(std::size_t mesh) = 0;
  /// Prepares the queries, after meshes were added or updated. Throws std::bad_alloc.
  virtual void commit() = 0;

  /// The first hit beyond the distance `near`.
  virtual TracedHit first_hit(const Eigen::Vector3f& from, const Eigen::Vector3f& d, float near) const = 0;
  /// First hits of rays that are similar to their neighbours. Directions that are NaN hit nothing.
  virtual void first_hits(const Eigen::Vector3f& from,
                          std::span<const Eigen::Vector3f> d,
                          std::span<TracedHit> hits) const = 0;
  /// Whether the line from `from` to each point is free, but for its last `gap` (m).
  virtual void reached(const Eigen::Vector3f& from,
                       std::span<const Eigen::Vector3f> p,
                       float gap,
                       std::span<std::uint8_t> reached) const = 0;
};

/// `moves`: meshes will be updated; queries then take a little longer. Throws std::bad_alloc. Error: the
/// shared library is not there, or a library that it needs is not installed.
Result<std::unique_ptr<RayTracer>> make_ray_tracer(bool moves);

}  // namespace limn::sim
