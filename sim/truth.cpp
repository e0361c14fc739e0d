#include "sim/truth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>
#include <random>
#include <utility>

#include "core/names.h"

namespace limn::sim {
namespace {

// m; a surface part within this distance is on the prototype (docs/formats.md).
constexpr double k_surface_reach = 2e-3;

std::vector<MeshInstance> physical_meshes(const World& world) {
  std::vector<MeshInstance> meshes;
  for (const Object& object : world.objects) meshes.push_back({object.mesh.get(), object.world_from_object});
  return meshes;
}

std::vector<MeshInstance> prototype_mesh(const World& world) {
  const Object* prototype = world.find("prototype");
  if (prototype == nullptr) return {};
  return {{prototype->mesh.get(), prototype->world_from_object}};
}

// The slot and the mesh of a posed part's variant; the world's scene must have both.
std::pair<const scene::Slot*, const scene::Mesh*> shape_of(const World& world, const scene::PosedPart& part) {
  LIMN_CHECK(world.scene.has_value());
  const scene::Slot* slot = world.scene->find_slot(part.slot);
  LIMN_CHECK(slot != nullptr);
  const scene::Variant* variant = find_named(slot->variants, part.variant);
  LIMN_CHECK(variant != nullptr);
  return {slot, &variant->mesh};
}

// World directions of every pixel centre.
std::vector<Eigen::Vector3f> world_directions(const Imager& imager) {
  std::vector<Eigen::Vector3f> d = direction_map(imager.lens, imager.width, imager.height);
  const Eigen::Matrix3f world_from_imager =
      imager.imager_from_world.inverse().rotation_matrix().cast<float>();
  for (Eigen::Vector3f& direction : d) direction = world_from_imager * direction;
  return d;
}

}  // namespace

Truth::Truth(const World& world, const scene::PosedScene& parts)
    : world_(world), physical_(physical_meshes(world)), prototype_(prototype_mesh(world)) {
  for (const scene::PosedPart& part : parts.parts) {
    const auto [slot, mesh] = shape_of(world, part);
    parts_.push_back({part, slot, mesh});
  }
}

std::optional<Landing> Truth::landing(const Imager& imager, const Eigen::Vector2d& px) const {
  const auto ray = imager.ray(px);
  if (!ray) return std::nullopt;
  const Hit hit = physical_.first_hit(*ray);
  if (hit.object < 0) return std::nullopt;
  const Object& object = world_.objects[static_cast<std::size_t>(hit.object)];
  const Eigen::Vector3d p_world = ray->p_origin + hit.distance * ray->d;
  Eigen::Vector3d n = physical_.face_normal(hit);
  if (n.dot(ray->d) > 0) n = -n;
  return Landing{object.name, p_world, object.world_from_object.inverse() * p_world, n};
}

bool Truth::visible(const Imager& imager, const Eigen::Vector3d& p_world) const {
  const auto px = imager.project(p_world);
  return px && imager.contains(*px) &&
         physical_.reached(imager.imager_from_world.inverse().translation, p_world);
}

std::vector<Hit> Truth::hits(const RayScene& scene, const Imager& imager) const {
  const std::vector<Eigen::Vector3f> d = world_directions(imager);
  const Eigen::Vector3d p_imager = imager.imager_from_world.inverse().translation;
  std::vector<Hit> hits(d.size());
  const auto width = static_cast<std::size_t>(imager.width);
  cv::parallel_for_({0, imager.height}, [&](const cv::Range& rows) {
    const std::size_t begin = static_cast<std::size_t>(rows.start) * width;
    const std::size_t count = static_cast<std::size_t>(rows.size()) * width;
    scene.first_hits(p_imager, std::span(d).subspan(begin, count), std::span(hits).subspan(begin, count));
  });
  return hits;
}

ObjectImage Truth::object_image(const Imager& imager) const {
  ObjectImage result;
  std::vector<MeshInstance> meshes = physical_meshes(world_);
  for (const Object& object : world_.objects) result.names.push_back(object.name);
  for (const Part& part : parts_) {
    meshes.push_back({part.mesh, part.posed.world_from_part});
    result.names.push_back("part-" + part.posed.slot);
  }
  const std::vector<Hit> found = hits(RayScene(meshes), imager);
  result.image.create(imager.height, imager.width, CV_16S);
  auto* out = result.image.ptr<std::int16_t>();
  for (std::size_t i = 0; i < found.size(); ++i) out[i] = static_cast<std::int16_t>(found[i].object);
  return result;
}

bool Truth::is_reached_by_projector(const Eigen::Vector3d& p_world, const Eigen::Vector3d& n_world) const {
  return std::any_of(world_.rig.projectors.begin(), world_.rig.projectors.end(),
                     [&](const Imager& projector) {
                       const auto px = projector.project(p_world);
                       if (!px || !projector.contains(*px)) return false;
                       const Eigen::Vector3d p_light = projector.imager_from_world.inverse().translation;
                       return n_world.dot(p_light - p_world) > 0 && prototype_.reached(p_light, p_world);
                     });
}

const Truth::Part* Truth::find_part(const std::string& slot) const {
  const auto found =
      std::find_if(parts_.begin(), parts_.end(), [&](const Part& p) { return p.posed.slot == slot; });
  return found == parts_.end() ? nullptr : &*found;
}

cv::Mat Truth::part_mask(const Imager& viewer, const std::string& slot) const {
  cv::Mat mask = cv::Mat::zeros(viewer.height, viewer.width, CV_8U);
  const Part* part = find_part(slot);
  if (part == nullptr) return mask;
  const std::vector<MeshInstance> meshes = {{part->mesh, part->posed.world_from_part}};
  const RayScene part_scene(meshes);
  const std::vector<Hit> part_hits = hits(part_scene, viewer), behind = hits(prototype_, viewer);
  const std::vector<Eigen::Vector3f> d = world_directions(viewer);
  const Eigen::Vector3d p_imager = viewer.imager_from_world.inverse().translation;
  auto* out = mask.ptr();
  for (std::size_t i = 0; i < part_hits.size(); ++i) {
    if (part_hits[i].object < 0) continue;
    if (behind[i].object < 0) {
      out[i] = 128;
      continue;
    }
    const Eigen::Vector3d direction = d[i].cast<double>();
    Eigen::Vector3d n = prototype_.face_normal(behind[i]);
    if (n.dot(direction) > 0) n = -n;
    const double slant =
        std::max(0.05, std::abs(n.dot(direction)));  // a ray runs 1 / slant longer than the gap
    const double allowed = part->slot->mode == scene::Mode::surface ? k_surface_reach / slant : 0;
    if (part_hits[i].distance > behind[i].distance + allowed) continue;
    out[i] = is_reached_by_projector(p_imager + behind[i].distance * direction, n) ? 255 : 128;
  }
  return mask;
}

std::vector<SampledPoint> surface_points(const scene::Mesh& mesh, int count, std::uint64_t seed) {
  const auto corner = [&](std::size_t t, std::size_t k) {
    return mesh.positions[mesh.triangles[t][k]].cast<double>().eval();
  };
  std::vector<double> area(mesh.triangles.size());
  for (std::size_t t = 0; t < area.size(); ++t)
    area[t] = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm() / 2;
  std::vector<double> until(area.size());
  std::partial_sum(area.begin(), area.end(), until.begin());
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<SampledPoint> points;
  for (int i = 0; i < count; ++i) {
    const auto at = std::upper_bound(until.begin(), until.end(), share(random) * until.back());
    const auto t = std::min(static_cast<std::size_t>(at - until.begin()), area.size() - 1);
    const double r = std::sqrt(share(random)), v = r * share(random), u = 1 - r;  // uniform in a triangle
    SampledPoint point;
    point.p = u * corner(t, 0) + v * corner(t, 1) + (1 - u - v) * corner(t, 2);
    point.n = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).normalized();
    if (!mesh.normals.empty()) {
      const auto& c = mesh.triangles[t];
      point.n = (u * mesh.normals[c[0]].cast<double>() + v * mesh.normals[c[1]].cast<double>() +
                 (1 - u - v) * mesh.normals[c[2]].cast<double>())
                    .normalized();
    }
    points.push_back(point);
  }
  return points;
}

World with_parts(const World& world, const scene::PosedScene& parts) {
  World shown = world;
  for (const scene::PosedPart& part : parts.parts) {
    const auto [slot, mesh] = shape_of(world, part);
    Object object;
    object.name = "part-" + part.slot;
    object.mesh = std::make_shared<scene::Mesh>(*mesh);
    object.world_from_object = part.world_from_part;
    object.by_material = true;
    shown.objects.push_back(std::move(object));
  }
  return shown;
}

}  // namespace limn::sim
