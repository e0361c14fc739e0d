#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/imager.h"
#include "core/pose.h"
#include "scene/mesh.h"

namespace limn::sim {

/// A mesh in its place.
struct MeshInstance {
  const scene::Mesh* mesh = nullptr;
  Pose world_from_mesh;
};

/// Where a ray first meets a surface. `distance` (m) is exact for the triangle that was hit: computed in
/// double precision from its plane, not taken from the ray tracer's single precision.
struct Hit {
  int object = -1;  ///< index of the placed mesh; -1: nothing
  int triangle = -1;
  double distance = 0;
  Eigen::Vector2f barycentric = {0, 0};  ///< weights of the triangle's second and third corner
};

/// Triangles in the world, ready for rays (Embree). Queries are safe from several threads.
class RayScene {
 public:
  explicit RayScene(std::span<const MeshInstance> meshes);
  ~RayScene();
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;

  /// Goes through what a material cuts out; many rays at once and light do not.
  Hit first_hit(const Ray& ray) const;
  /// Many rays from one point; directions that are NaN hit nothing.
  void first_hits(const Eigen::Vector3d& p_origin,
                  std::span<const Eigen::Vector3f> d,
                  std::span<Hit> hits) const;
  /// Whether the straight line from each point (on a surface) to p_light is free: what lies within 0.1 mm of
  /// the point does not count.
  void reached(const Eigen::Vector3d& p_light,
               std::span<const Eigen::Vector3f> p,
               std::span<std::uint8_t> reached) const;
  bool reached(const Eigen::Vector3d& p_light, const Eigen::Vector3d& p) const;

  /// Geometric normal of the triangle, by its corners' order, unit.
  Eigen::Vector3d face_normal(const Hit& hit) const;
  /// Normal interpolated from the mesh's, unit; the geometric one when the mesh has none.
  Eigen::Vector3d shading_normal(const Hit& hit) const;
  /// Normal that lies so many lengths along the mesh's tangent, its bitangent and the interpolated normal
  /// (the first two made perpendicular to that), unit; the interpolated one when the mesh has no tangents.
  Eigen::Vector3d mapped_normal(const Hit& hit, const Eigen::Vector3d& along) const;
  /// Coordinates in the image of the mesh's uv; zero when it has none.
  Eigen::Vector2f uv(const Hit& hit) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::sim
