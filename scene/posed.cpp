#include "scene/posed.h"

#include <algorithm>

#include "core/config.h"
#include "scene/nearest.h"

namespace limn::scene {
namespace {

// A lost body is not where its track says: it is as if it were not seen.
const Track* find_track(std::span<const Track> tracks, const std::string& body) {
  const auto found = std::find_if(tracks.begin(), tracks.end(),
                                  [&](const Track& t) { return t.body == body && t.sight != Sight::lost; });
  return found == tracks.end() ? nullptr : &*found;
}

// The marker laid onto the prototype's surface: centre on the nearest point, z into the surface by the
// shortest turn, so that its turn about z stays. The side of the surface is the one the marker faces, so that
// a mesh with its normals inside out serves, too.
Pose laid_on(const Mesh& prototype, const Pose& prototype_from_marker) {
  const SurfacePoint point = nearest_on(prototype, prototype_from_marker.translation);
  const Eigen::Vector3d d_marker_z = prototype_from_marker.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d d_inward = d_marker_z.dot(point.d_normal) > 0 ? point.d_normal : -point.d_normal;
  const auto turn = Eigen::Quaterniond::FromTwoVectors(d_marker_z, d_inward);
  return Pose(turn * prototype_from_marker.rotation, point.p);
}

std::string chosen_variant(const Slot& slot, std::size_t index, std::span<const std::string> variants) {
  return index < variants.size() && !variants[index].empty() ? variants[index] : slot.variants.front().name;
}

bool has_variant(const Slot& slot, const std::string& name) {
  return std::any_of(slot.variants.begin(), slot.variants.end(),
                     [&](const Variant& v) { return v.name == name; });
}

PosedPart read_part(const ConfigNode& node, const Slot& slot) {
  node.only({"world_from_part", "variant"});
  PosedPart part{slot.name, slot.variants.front().name, node.at("world_from_part").pose()};
  if (const auto variant = node.find("variant")) {
    part.variant = variant->text();
    if (!has_variant(slot, part.variant)) {
      std::string names;
      for (const Variant& known : slot.variants) names += (names.empty() ? "" : ", ") + known.name;
      variant->problem(fmt::format("expected a variant of the slot ({}), found '{}'.", names, part.variant));
    }
  }
  return part;
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
    Pose world_from_marker = track->world_from_body;
    if (slot.stick_to_surface && prototype) {
      const Pose& world_from_prototype = prototype->world_from_body;
      world_from_marker = world_from_prototype *
                          laid_on(scene.prototype->mesh, world_from_prototype.inverse() * world_from_marker);
    }
    out.parts.push_back(
        {slot.name, chosen_variant(slot, i, variants), world_from_marker * slot.marker_from_part});
  }
  return out;
}

Result<PosedScene> load_poses(const std::filesystem::path& path, const Scene& scene) {
  LIMN_TRY(const Config config, Config::load(path, ""));
  const ConfigNode root = config.root();
  root.only({"schema", "world_from_prototype", "slots"});
  PosedScene out;
  if (const auto pose = root.find("world_from_prototype")) out.world_from_prototype = pose->pose();
  if (const auto slots = root.find("slots")) {
    for (const std::string& name : slots->keys()) {
      if (!scene.find_slot(name)) {
        std::string names;
        for (const Slot& known : scene.slots) names += (names.empty() ? "" : ", ") + known.name;
        slots->at(name).problem(fmt::format("expected a slot of the scene ({}), found '{}'.", names, name));
      }
    }
    for (const Slot& slot : scene.slots) {
      if (const auto node = slots->find(slot.name)) out.parts.push_back(read_part(*node, slot));
    }
  }
  LIMN_TRY_STATUS(config.status());
  return out;
}

}  // namespace limn::scene
