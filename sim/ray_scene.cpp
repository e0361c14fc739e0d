#include "sim/ray_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "core/result.h"
#include "sim/ray_tracer.h"
#include "sim/texture.h"

namespace limn::sim {
namespace {

// A ray continues behind a cut-out after this share of its distance, but at least after this length (m).
constexpr float k_behind_cut_out = 1e-6F;
constexpr double k_surface_gap = 1e-4;  // m; nearer surfaces do not occlude a shadow ray

struct Placed {
  const scene::Mesh* mesh = nullptr;
  Pose world_from_mesh;
  std::vector<Eigen::Vector3f>
      positions;  // in the world frame; shared with Embree, which may read 4 bytes past the end

  void place(const Pose& pose) {
    world_from_mesh = pose;
    positions.clear();
    positions.reserve(mesh->positions.size() + 1);
    for (const Eigen::Vector3f& p : mesh->positions)
      positions.push_back((world_from_mesh * p.cast<double>()).cast<float>());
    positions.push_back(Eigen::Vector3f::Zero());
  }
};

}  // namespace

struct RayScene::Impl {
  std::vector<Placed> placed;
  std::unique_ptr<RayTracer> tracer;

  const std::array<std::uint32_t, 3>& corners(const Hit& hit) const {
    return placed[static_cast<std::size_t>(hit.object)]
        .mesh->triangles[static_cast<std::size_t>(hit.triangle)];
  }
  Eigen::Vector3d corner(const Hit& hit, std::size_t k) const {
    return placed[static_cast<std::size_t>(hit.object)].positions[corners(hit)[k]].cast<double>();
  }
  Eigen::Vector3d scaled_normal(const Hit& hit) const {
    const Eigen::Vector3d p = corner(hit, 0);
    return (corner(hit, 1) - p).cross(corner(hit, 2) - p);
  }

  Hit completed(const TracedHit& found, const Eigen::Vector3d& p_origin, const Eigen::Vector3d& d) const {
    if (found.mesh < 0) return {};
    Hit hit{.object = found.mesh, .triangle = found.triangle, .barycentric = {found.u, found.v}};
    const Eigen::Vector3d n = scaled_normal(hit);
    const double approach = n.dot(d);
    const double exact = n.dot(corner(hit, 0) - p_origin) / approach;
    const double traced = static_cast<double>(found.distance);
    // Triangles seen edge-on have no usable plane; for them the traced distance is the best value.
    hit.distance = std::abs(exact - traced) < 1e-3 ? exact : traced;
    return hit;
  }
};

RayScene::RayScene(std::span<const MeshInstance> meshes, bool moves) : impl_(std::make_unique<Impl>()) {
  auto tracer = make_ray_tracer(moves);
  if (!tracer) throw std::runtime_error(tracer.message());
  impl_->tracer = std::move(*tracer);
  impl_->placed.resize(meshes.size());
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    Placed& placed = impl_->placed[i];
    placed.mesh = meshes[i].mesh;
    placed.place(meshes[i].world_from_mesh);
    impl_->tracer->add_mesh(std::span(placed.positions).first(placed.mesh->positions.size()),
                            placed.mesh->triangles);
  }
  impl_->tracer->commit();
}

void RayScene::move(std::span<const std::size_t> meshes, std::span<const Pose> world_from_mesh) {
  for (std::size_t k = 0; k < meshes.size(); ++k) {
    impl_->placed[meshes[k]].place(world_from_mesh[k]);  // the memory stays where it is
    impl_->tracer->update_mesh(meshes[k]);
  }
  impl_->tracer->commit();
}

RayScene::~RayScene() = default;
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene& RayScene::operator=(RayScene&&) noexcept = default;

Hit RayScene::first_hit(const Ray& ray) const {
  constexpr int k_most_cut_out = 64;  // number of cut-out layers that a ray passes
  float near = 0;
  for (int layer = 0; layer < k_most_cut_out; ++layer) {
    const TracedHit traced = impl_->tracer->first_hit(ray.p_origin.cast<float>(), ray.d.cast<float>(), near);
    const Hit hit = impl_->completed(traced, ray.p_origin, ray.d);
    if (hit.object < 0) return hit;
    const scene::Mesh& mesh = *impl_->placed[static_cast<std::size_t>(hit.object)].mesh;
    if (!is_cut_out(mesh, hit.triangle, uv(hit))) return hit;
    near = traced.distance + k_behind_cut_out * std::max(1.0F, traced.distance);
  }
  return {};
}

Hit RayScene::next_surface(const Ray& ray) const {
  return impl_->completed(impl_->tracer->first_hit(ray.p_origin.cast<float>(), ray.d.cast<float>(), 0),
                          ray.p_origin, ray.d);
}

void RayScene::first_hits(const Eigen::Vector3d& p_origin,
                          std::span<const Eigen::Vector3f> d,
                          std::span<Hit> hits) const {
  std::vector<TracedHit> traced(d.size());
  impl_->tracer->first_hits(p_origin.cast<float>(), d, traced);
  for (std::size_t i = 0; i < d.size(); ++i)
    hits[i] = impl_->completed(traced[i], p_origin, d[i].cast<double>());
}

void RayScene::reached(const Eigen::Vector3d& p_light,
                       std::span<const Eigen::Vector3f> p,
                       std::span<std::uint8_t> reached) const {
  impl_->tracer->reached(p_light.cast<float>(), p, static_cast<float>(k_surface_gap), reached);
}

bool RayScene::reached(const Eigen::Vector3d& p_light, const Eigen::Vector3d& p) const {
  const Eigen::Vector3f point = p.cast<float>();
  std::uint8_t result = 0;
  reached(p_light, std::span(&point, 1), std::span(&result, 1));
  return result != 0;
}

Eigen::Vector3d RayScene::face_normal(const Hit& hit) const { return impl_->scaled_normal(hit).normalized(); }

Eigen::Vector3d RayScene::shading_normal(const Hit& hit) const {
  const Placed& placed = impl_->placed[static_cast<std::size_t>(hit.object)];
  const auto& normals = placed.mesh->normals;
  if (normals.empty()) return face_normal(hit);
  const auto& c = impl_->corners(hit);
  const float u = hit.barycentric.x(), v = hit.barycentric.y();
  const Eigen::Vector3f n = (1 - u - v) * normals[c[0]] + u * normals[c[1]] + v * normals[c[2]];
  return (placed.world_from_mesh.rotation * n.cast<double>()).normalized();
}

Eigen::Vector3d RayScene::mapped_normal(const Hit& hit, const Eigen::Vector3d& along) const {
  const Placed& placed = impl_->placed[static_cast<std::size_t>(hit.object)];
  const Eigen::Vector3d n = shading_normal(hit);
  const auto& tangents = placed.mesh->tangents;
  if (tangents.empty()) return n;
  const auto& c = impl_->corners(hit);
  const float u = hit.barycentric.x(), v = hit.barycentric.y();
  const Eigen::Vector4f t = (1 - u - v) * tangents[c[0]] + u * tangents[c[1]] + v * tangents[c[2]];
  const Eigen::Vector3d to_u = placed.world_from_mesh.rotation * t.head<3>().cast<double>();
  const Eigen::Vector3d d_v = (t.w() < 0 ? -1.0 : 1.0) * n.cross(to_u).normalized();
  const Eigen::Vector3d d_u = (to_u - to_u.dot(n) * n).normalized();
  return (along.x() * d_u + along.y() * d_v + along.z() * n).normalized();
}

Eigen::Vector2f RayScene::uv(const Hit& hit) const {
  const auto& uvs = impl_->placed[static_cast<std::size_t>(hit.object)].mesh->uvs;
  if (uvs.empty()) return Eigen::Vector2f::Zero();
  const auto& c = impl_->corners(hit);
  const float u = hit.barycentric.x(), v = hit.barycentric.y();
  return (1 - u - v) * uvs[c[0]] + u * uvs[c[1]] + v * uvs[c[2]];
}

Eigen::Vector2f RayScene::second_uv(const Hit& hit) const {
  const auto& uvs = impl_->placed[static_cast<std::size_t>(hit.object)].mesh->second_uvs;
  if (uvs.empty()) return Eigen::Vector2f::Zero();
  const auto& c = impl_->corners(hit);
  const float u = hit.barycentric.x(), v = hit.barycentric.y();
  return (1 - u - v) * uvs[c[0]] + u * uvs[c[1]] + v * uvs[c[2]];
}

Eigen::Vector3f RayScene::colour(const Hit& hit) const {
  const auto& colours = impl_->placed[static_cast<std::size_t>(hit.object)].mesh->colours;
  if (colours.empty()) return Eigen::Vector3f::Ones();
  const auto& c = impl_->corners(hit);
  const float u = hit.barycentric.x(), v = hit.barycentric.y();
  return (1 - u - v) * colours[c[0]] + u * colours[c[1]] + v * colours[c[2]];
}

}  // namespace limn::sim
