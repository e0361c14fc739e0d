#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/imager.h"
#include "core/pose.h"
#include "scene/meshes/mesh.h"

namespace limn::sim {

/// A mesh with its pose.
struct MeshInstance {
  const scene::Mesh* mesh = nullptr;
  Pose world_from_mesh;
};

/// Where a ray first hits a surface. `distance` (m) is exact for the triangle that was hit: computed in
/// double precision from its plane, not taken from the ray tracer's single precision.
struct Hit {
  int object = -1;  ///< Index of the mesh instance; -1: nothing.
  int triangle = -1;
  double distance = 0;
  Eigen::Vector2f barycentric = {0, 0};  ///< Weights of the triangle's second and third corner.
};

/// Triangles in the world frame, prepared for ray queries (Embree). Queries are thread-safe.
class RayScene {
 public:
  /// `moves`: move() will be called; queries then take a little longer.
  explicit RayScene(std::span<const MeshInstance> meshes, bool moves = false);
  ~RayScene();
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;

  /// Moves some of the meshes, given by their indices. Only for a scene that was made for this.
  void move(std::span<const std::size_t> meshes, std::span<const Pose> world_from_mesh);

  /// The first hit of a ray. The ray passes through pieces below a material's alpha cutoff. first_hits() and
  /// reached() ignore the cutoff.
  Hit first_hit(const Ray& ray) const;
  /// The first surface along a ray, also where a material's alpha is below its cutoff.
  Hit next_surface(const Ray& ray) const;
  /// First hits of many rays from one point. Directions that are NaN hit nothing.
  void first_hits(const Eigen::Vector3d& p_origin,
                  std::span<const Eigen::Vector3f> d,
                  std::span<Hit> hits) const;
  /// Whether the line from each point (on a surface) to p_light is free. Surfaces within 0.1 mm of the point
  /// are ignored.
  void reached(const Eigen::Vector3d& p_light,
               std::span<const Eigen::Vector3f> p,
               std::span<std::uint8_t> reached) const;
  bool reached(const Eigen::Vector3d& p_light, const Eigen::Vector3d& p) const;

  /// Unit geometric normal of the triangle; its sign follows the order of the corners.
  Eigen::Vector3d face_normal(const Hit& hit) const;
  /// Unit normal interpolated from the mesh's normals; the geometric one when the mesh has none.
  Eigen::Vector3d shading_normal(const Hit& hit) const;
  /// Unit normal from a normal map: `along` holds its components along tangent, bitangent and interpolated
  /// normal (tangent and bitangent are made perpendicular to the normal). The interpolated normal when the
  /// mesh has no tangents.
  Eigen::Vector3d mapped_normal(const Hit& hit, const Eigen::Vector3d& along) const;
  /// Texture coordinates interpolated from the mesh; zero when it has none.
  Eigen::Vector2f uv(const Hit& hit) const;
  /// The same for the mesh's second texture coordinates.
  Eigen::Vector2f second_uv(const Hit& hit) const;
  /// Linear RGB interpolated from the mesh's colours; ones when it has none.
  Eigen::Vector3f colour(const Hit& hit) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::sim
