#include "scene/posed_scene.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "core/config.h"
#include "core/linear_algebra.h"
#include "core/names.h"
#include "scene/meshes/mesh_bvh.h"

namespace limn::scene {
namespace {

// The pose of a lost body is not reliable, so the body counts as not seen.
const Track* find_track(std::span<const Track> tracks, const std::string& body) {
  const auto found = std::find_if(tracks.begin(), tracks.end(), [&](const Track& t) {
    return t.body == body && t.tracking != TrackingState::lost;
  });
  return found == tracks.end() ? nullptr : &*found;
}

// Errors that the corners' covariance does not contain: the distance of the mesh, the calibration and a
// marker's paper from the true surface. It also keeps a covariance invertible that is zero along some line.
constexpr double k_unknown_place = 0.2e-3;  // m
// A marker that is less certain than this, after it was not seen for long, is laid on the nearest place.
constexpr double k_most_unknown_place = 1;  // m

// Covariance of the marker's centre in the prototype's frame, from the covariances of both poses.
Eigen::Matrix3d place_covariance(const Track& prototype, const Track& marker) {
  const Eigen::Vector3d d = marker.world_from_body.translation - prototype.world_from_body.translation;
  Eigen::Matrix<double, 3, 6>
      by_prototype;  // derivative of R^T (p - t), in world axes, by the delta of the prototype's pose
  by_prototype << 0, -d.z(), d.y(), -1, 0, 0,  //
      d.z(), 0, -d.x(), 0, -1, 0,              //
      -d.y(), d.x(), 0, 0, 0, -1;
  const Eigen::Matrix3d world = marker.covariance.bottomRightCorner<3, 3>() +
                                by_prototype * prototype.covariance * by_prototype.transpose() +
                                k_unknown_place * k_unknown_place * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d world_from_prototype = prototype.world_from_body.rotation_matrix();
  return world_from_prototype.transpose() * world * world_from_prototype;
}

// The marker's pose moved onto the prototype's surface, which leaves three degrees of freedom of six. The
// centre goes to the most likely point: the depth of a single marker is uncertain, so it moves along the
// viewing ray. The smallest rotation turns z into the surface, so that the rotation about z stays; the two
// solutions of the planar pose ambiguity differ by just such a rotation. The marker's own orientation selects
// the side of the surface, so that a mesh with inverted normals works, too.
Pose laid_on(const Mesh& mesh, const Track& prototype, const Track& marker) {
  const Pose prototype_from_marker = prototype.world_from_body.inverse() * marker.world_from_body;
  const Eigen::Matrix3d covariance = place_covariance(prototype, marker);
  const bool is_known = covariance.trace() < k_most_unknown_place * k_most_unknown_place;
  const MeshPoint point = is_known ? most_likely_on(mesh, prototype_from_marker.translation, covariance)
                                   : nearest_on(mesh, prototype_from_marker.translation);
  const Eigen::Vector3d d_marker_z = prototype_from_marker.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d d_inward = d_marker_z.dot(point.d_normal) > 0 ? point.d_normal : -point.d_normal;
  const Eigen::Quaterniond turn = rotation_between(d_marker_z, d_inward);
  return prototype.world_from_body * Pose(turn * prototype_from_marker.rotation, point.p);
}

std::string chosen_variant(const Slot& slot, std::size_t index, std::span<const std::string> variants) {
  return index < variants.size() && !variants[index].empty() ? variants[index] : slot.variants.front().name;
}

PosedPart read_part(const ConfigNode& node, const Slot& slot) {
  node.only({"world_from_part", "variant"});
  PosedPart part{slot.name, slot.variants.front().name, node.at("world_from_part").pose()};
  if (const auto variant = node.find("variant")) {
    part.variant = variant->text();
    if (!find_named(slot.variants, part.variant))
      variant->problem(fmt::format("expected a variant of the slot ({}), found '{}'.",
                                   joined_names(slot.variants), part.variant));
  }
  return part;
}

std::vector<Viewpoint> fixed_viewpoints(const Scene& scene) {
  std::vector<Viewpoint> viewpoints;
  for (std::size_t i = 0; i < scene.viewers.size(); ++i) {
    const Viewer& viewer = scene.viewers[i];
    if (viewer.fixed)
      viewpoints.push_back(
          {viewer_body(i), viewer.fixed->imager_from_world.inverse().translation, viewer.weight});
  }
  return viewpoints;
}

std::optional<Imager> viewer_towards(const Eigen::Vector3d& p_eye,
                                     const Eigen::Vector3d& p_middle,
                                     const Eigen::Vector3d& d_up_world) {
  const Eigen::Vector3d d = (p_middle - p_eye).normalized();
  if (!d.allFinite()) return std::nullopt;
  const Eigen::Vector3d d_up = std::abs(d.dot(d_up_world)) < 0.99 ? d_up_world : d.unitOrthogonal();
  return viewer_imager(looking_at(p_eye, p_middle, d_up).inverse(), 1280, 800, 40);
}

}  // namespace

PosedScene posed(const Scene& scene, std::span<const Track> tracks, std::span<const std::string> variants) {
  PosedScene out;
  const Track* prototype = scene.prototype ? find_track(tracks, "prototype") : nullptr;
  if (prototype) out.world_from_prototype = prototype->world_from_body;
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    const Slot& slot = scene.slots[i];
    const Track* track = find_track(tracks, slot.name);
    if (!track) continue;
    const Pose world_from_marker = slot.stick_to_surface && prototype
                                       ? laid_on(scene.prototype->mesh, *prototype, *track)
                                       : track->world_from_body;
    out.parts.push_back(
        {slot.name, chosen_variant(slot, i, variants), world_from_marker * slot.marker_from_part});
  }
  out.viewpoints = fixed_viewpoints(scene);
  out.lines = first_lines(scene);
  for (std::size_t i = 0; i < scene.viewers.size(); ++i)
    if (const Track* track = scene.viewers[i].marker || scene.viewers[i].is_tracked
                                 ? find_track(tracks, viewer_body(i))
                                 : nullptr)
      out.viewpoints.push_back(
          {track->body, track->world_from_body * scene.viewers[i].p_eye_marker, scene.viewers[i].weight});
  return out;
}

void add_outlines(const Scene& scene, PosedScene* posed) {
  if (!scene.outlines || !posed->world_from_prototype) return;
  std::size_t points = 0;
  for (const DrawnLine& line : posed->drawn) points += line.curve.points.size();
  for (const Line& line : scene.lines) {
    if (line.outline_of.empty() ||
        std::find(posed->lines.begin(), posed->lines.end(), line.name) == posed->lines.end())
      continue;
    for (const PosedPart& part : posed->parts) {
      const Slot* slot = part.slot == line.outline_of ? scene.find_slot(part.slot) : nullptr;
      const Variant* variant = slot ? find_named(slot->variants, part.variant) : nullptr;
      if (!variant) continue;
      for (const SurfaceCurve& curve :
           scene.outlines->of(part.slot + "/" + part.variant, variant->mesh,
                              posed->world_from_prototype->inverse() * part.world_from_part)) {
        points += curve.points.size();
        if (points <= k_most_points_shown) posed->drawn.push_back({line.name, line.style, curve});
      }
    }
  }
}

bool is_same_prototype(const PosedScene& a, const PosedScene& b) {
  if (a.world_from_prototype.has_value() != b.world_from_prototype.has_value()) return false;
  return !a.world_from_prototype || limn::is_same(*a.world_from_prototype, *b.world_from_prototype);
}

bool is_same(const PosedScene& a, const PosedScene& b) {
  return a.lines == b.lines && a.drawn == b.drawn && is_same_without_lines(a, b);
}

bool is_same_without_lines(const PosedScene& a, const PosedScene& b) {
  return is_same_prototype(a, b) && a.light == b.light && a.finish == b.finish && a.cut == b.cut &&
         a.deviation == b.deviation &&
         std::equal(a.parts.begin(), a.parts.end(), b.parts.begin(), b.parts.end(),
                    [](const PosedPart& p, const PosedPart& q) {
                      return p.slot == q.slot && p.variant == q.variant && p.material == q.material &&
                             p.window == q.window && limn::is_same(p.world_from_part, q.world_from_part);
                    });
}

std::optional<Eigen::Vector3d> middle_of(const Scene& scene, const PosedScene& posed) {
  Eigen::AlignedBox3d box;
  if (scene.prototype && posed.world_from_prototype)
    for (const Eigen::Vector3f& p : scene.prototype->mesh.positions)
      box.extend(*posed.world_from_prototype * p.cast<double>());
  else
    for (const PosedPart& part : posed.parts) box.extend(part.world_from_part.translation);
  if (box.isEmpty()) return std::nullopt;
  return box.center();
}

std::optional<Imager> viewer_at(const Eigen::Vector3d& p_eye_world,
                                const Scene& scene,
                                const PosedScene& posed,
                                const Eigen::Vector3d& d_up_world) {
  const auto p_middle = middle_of(scene, posed);
  return p_middle ? viewer_towards(p_eye_world, *p_middle, d_up_world) : std::nullopt;
}

std::optional<Imager> viewer_of(const Scene& scene,
                                const PosedScene& posed,
                                const Eigen::Vector3d& d_up_world) {
  if (scene.viewers.size() == 1 && scene.viewers[0].fixed) return scene.viewers[0].fixed;
  const auto p_middle = middle_of(scene, posed);
  if (!p_middle) return std::nullopt;
  const auto p_eye = updated_viewpoint({}, posed.viewpoints, *p_middle, 0).p_world();
  return p_eye ? viewer_towards(*p_eye, *p_middle, d_up_world) : std::nullopt;
}

std::vector<Track> tracks_of(const Scene& scene, const PosedScene& posed) {
  std::vector<Track> tracks;
  const auto add = [&](const std::string& body, const Pose& world_from_body) {
    tracks.emplace_back();
    tracks.back().body = body;
    tracks.back().world_from_body = world_from_body;
  };
  if (posed.world_from_prototype) add("prototype", *posed.world_from_prototype);
  for (const PosedPart& part : posed.parts)
    if (const Slot* slot = scene.find_slot(part.slot))
      add(part.slot, part.world_from_part * slot->marker_from_part.inverse());
  return tracks;
}

Result<PosedScene> load_poses(const std::filesystem::path& path, const Scene& scene) {
  LIMN_TRY(const Config config, Config::load(path, ""));
  const ConfigNode root = config.root();
  root.only({"schema", "world_from_prototype", "slots", "finish", "cut", "lines"});
  PosedScene out;
  out.viewpoints = fixed_viewpoints(scene);
  if (const auto pose = root.find("world_from_prototype")) out.world_from_prototype = pose->pose();
  if (const auto finish = root.find("finish")) out.finish = finish->choice(finish_names(scene));
  if (const auto cut = root.find("cut")) {
    out.cut = read_cut_plane(*cut);
    if (!scene.section) cut->problem("expected a scene with a section, found one without.");
  }
  out.lines = first_lines(scene);
  if (const auto lines = root.find("lines")) {
    std::vector<std::string> names;
    for (const Line& line : scene.lines) names.push_back(line.name);
    out.lines.clear();
    for (const ConfigNode& item : lines->items()) out.lines.push_back(item.choice(names));
  }
  if (const auto slots = root.find("slots")) {
    for (const std::string& name : slots->keys()) {
      if (!scene.find_slot(name))
        slots->at(name).problem(
            fmt::format("expected a slot of the scene ({}), found '{}'.", joined_names(scene.slots), name));
    }
    for (const Slot& slot : scene.slots) {
      if (const auto node = slots->find(slot.name)) out.parts.push_back(read_part(*node, slot));
    }
  }
  LIMN_TRY_STATUS(config.status());
  add_outlines(scene, &out);
  return out;
}

}  // namespace limn::scene
