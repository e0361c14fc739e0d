#include "validate/check_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "core/config.h"
#include "core/names.h"
#include "core/scale_resolution.h"
#include "tracker/marker_image.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;

// Reads a viewer as in a viewer file, or with eye_m and target_m instead of the pose.
Imager read_imager(const ConfigNode& node) {
  const auto [width, height] = node.at("size").image_size();
  double fov_deg = node.at("fov_deg").positive();
  if (fov_deg >= 180) {
    node.at("fov_deg").problem(fmt::format("expected an angle below 180 degrees, found {}.", fov_deg));
    fov_deg = 40;
  }
  if (const auto pose = node.find("world_from_viewer"))
    return viewer_imager(pose->pose(), width, height, fov_deg);
  const Eigen::Vector3d p_viewer = node.at("eye_m").vector3(), p_target = node.at("target_m").vector3();
  const Eigen::Vector3d d = p_target - p_viewer;
  if (d.head<2>().norm() < 1e-6 * std::max(1.0, d.norm())) {
    node.at("target_m")
        .problem(
            "expected a target at a distance from the eye and not straight above or below it. Give "
            "world_from_viewer instead.");
    return viewer_imager({}, width, height, fov_deg);
  }
  return viewer_imager(looking_at(p_viewer, p_target, Eigen::Vector3d::UnitZ()).inverse(), width, height,
                       fov_deg);
}

struct Viewer {
  Imager imager;
  double weight = 1;
};

Viewer read_viewer(const ConfigNode& node, bool is_one_of_several) {
  if (!is_one_of_several) {
    node.only({"world_from_viewer", "eye_m", "target_m", "size", "fov_deg"});
    return {read_imager(node)};
  }
  node.only({"world_from_viewer", "eye_m", "target_m", "size", "fov_deg", "weight"});
  Viewer viewer{read_imager(node)};
  if (const auto weight = node.find("weight")) viewer.weight = weight->positive();
  return viewer;
}

// Reads one viewer, or a list of several.
std::vector<Viewer> read_viewers(const ConfigNode& node) {
  if (!node.is_array()) return {read_viewer(node, false)};
  std::vector<Viewer> viewers;
  for (const ConfigNode& item : node.items()) viewers.push_back(read_viewer(item, true));
  if (viewers.empty()) node.problem("expected at least one viewer, found none.");
  return viewers;
}

std::vector<CheckLimit> read_limits(const ConfigNode& node) {
  std::set<std::string> known;
  for (const CheckMeasure& measure : check_measures()) known.insert(measure.name);
  node.only(known);
  std::vector<CheckLimit> limits;
  for (const CheckMeasure& measure : check_measures()) {
    const auto limit = node.find(measure.name);
    if (!limit) continue;
    limits.push_back({measure, limit->number()});
    if (limits.back().value < 0)
      limit->problem(fmt::format("expected a limit that is not negative, found {}.", limits.back().value));
  }
  if (limits.empty())
    node.problem(fmt::format("expected at least one limit of: {}; found none.", joined_names(known)));
  return limits;
}

// Replaces the world's scene, and the prototype in the world by that scene's.
void replace_scene(scene::Scene scene, sim::World* world) {
  world->scene = std::move(scene);
  std::erase_if(world->objects, [](const sim::Object& object) { return object.name == "prototype"; });
  if (!world->scene->prototype) return;
  sim::Object object;
  object.name = "prototype";
  object.mesh = std::make_shared<scene::Mesh>(world->scene->prototype->mesh);
  object.world_from_object = world->world_from_prototype;
  object.prototype_from_object = Pose();
  world->objects.push_back(std::move(object));
}

const scene::Slot* known_slot(const scene::Scene& scene, const std::string& name, const ConfigNode& node) {
  const scene::Slot* slot = scene.find_slot(name);
  if (slot) return slot;
  node.problem(
      fmt::format("expected a slot of the scene ({}), found '{}'.", joined_names(scene.slots), name));
  return nullptr;
}

struct SlotPlace {
  std::optional<Pose> world_from_part;
  std::string variant;
};

SlotPlace read_slot(const ConfigNode& node, const scene::Slot& slot, const Pose& world_from_prototype) {
  node.only({"world_from_part", "prototype_from_part", "variant"});
  SlotPlace place;
  if (const auto pose = node.find("prototype_from_part"))
    place.world_from_part = world_from_prototype * pose->pose();
  if (const auto pose = node.find("world_from_part")) place.world_from_part = pose->pose();
  if (const auto variant = node.find("variant")) {
    std::vector<std::string> names;
    for (const scene::Variant& known : slot.variants) names.push_back(known.name);
    place.variant = variant->choice(names);
  }
  return place;
}

// The poses as in the world, except those that the file gives.
scene::PosedScene read_poses(const ConfigNode& node, sim::World* world) {
  node.only({"world_from_prototype", "slots", "shown", "finish"});
  const scene::Scene& scene = *world->scene;
  if (const auto pose = node.find("world_from_prototype")) sim::move_prototype(*world, pose->pose());
  std::vector<std::string> variants(scene.slots.size());
  std::vector<SlotPlace> places(scene.slots.size());
  if (const auto slots = node.find("slots")) {
    for (const std::string& name : slots->keys()) {
      const scene::Slot* slot = known_slot(scene, name, slots->at(name));
      if (!slot) continue;
      const auto i = static_cast<std::size_t>(slot - scene.slots.data());
      places[i] = read_slot(slots->at(name), *slot, world->world_from_prototype);
      variants[i] = places[i].variant;
    }
  }
  std::set<std::string> shown;
  for (const scene::Slot& slot : scene.slots) shown.insert(slot.name);
  if (const auto names = node.find("shown")) {
    shown.clear();
    for (const ConfigNode& name : names->items())
      if (known_slot(scene, name.text(), name)) shown.insert(name.text());
  }
  const scene::PosedScene standing = sim::true_poses(*world, variants);
  scene::PosedScene posed{world->world_from_prototype, {}, standing.viewpoints};
  if (const auto finish = node.find("finish")) posed.finish = finish->choice(scene::finish_names(scene));
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    const scene::Slot& slot = scene.slots[i];
    if (!shown.contains(slot.name)) continue;
    const auto found = std::find_if(standing.parts.begin(), standing.parts.end(),
                                    [&](const scene::PosedPart& part) { return part.slot == slot.name; });
    if (places[i].world_from_part) {
      const std::string& variant = places[i].variant;
      posed.parts.push_back(
          {slot.name, variant.empty() ? slot.variants.front().name : variant, *places[i].world_from_part});
    } else if (found != standing.parts.end()) {
      posed.parts.push_back(*found);
    } else {
      node.problem(fmt::format(
          "expected slots.{}.world_from_part, because no marker of it is in the world, found none.",
          slot.name));
    }
  }
  return posed;
}

Result<scene::PosedScene> poses_of(const std::optional<ConfigNode>& node,
                                   const fs::path& folder,
                                   sim::World* world) {
  if (!node || !node->is_string()) return read_poses(node.value_or(ConfigNode()), world);
  LIMN_TRY(scene::PosedScene posed, scene::load_poses(folder / node->text(), *world->scene));
  if (posed.world_from_prototype) sim::move_prototype(*world, *posed.world_from_prototype);
  posed.world_from_prototype = world->world_from_prototype;
  posed.viewpoints = sim::true_poses(*world).viewpoints;
  return posed;
}

void coarsen(const ConfigNode& node, Rig* rig) {
  const Status done = scale_resolution(node.positive(), rig);
  if (!done) node.problem(done.message());
}

// Chooses the file's viewers, or else the scene's. Several are replaced by their shared viewpoint, with an
// image like the first one's.
Status choose_viewer(const std::vector<Viewer>& viewers, Check* check) {
  const scene::Scene& scene = check->renderer_input.scene;
  std::vector<scene::Viewpoint> viewpoints = check->posed.viewpoints;
  std::optional<Imager> like;
  if (!viewers.empty()) {
    viewpoints.clear();
    like = viewers[0].imager;
    for (const Viewer& viewer : viewers)
      viewpoints.push_back({fmt::format("viewer{}", viewpoints.size()),
                            viewer.imager.imager_from_world.inverse().translation, viewer.weight});
  } else if (!scene.viewers.empty()) {
    like = scene.viewers[0].fixed;
  }
  const bool is_alone = viewers.empty() ? scene.viewers.size() == 1 : viewers.size() == 1;
  if (is_alone && like) {
    check->viewer = *like;
    return {};
  }
  const Eigen::Vector3d d_up_world = Eigen::Vector3d::UnitZ();
  if (viewpoints.empty())
    return error("viewer: expected one, because the scene has none in the world, found none.");
  const scene::SharedViewpoint shared =
      scene::updated_viewpoint({}, viewpoints, *scene::middle_of(scene, check->posed), 0);
  const auto viewer = scene::viewer_at(*shared.p_world(), scene, check->posed, d_up_world);
  if (!viewer)
    return error(
        "viewer: expected viewers at a distance from the prototype, found their shared viewpoint in its "
        "middle.");
  check->viewer = *viewer;
  if (like) {
    const double half = 0.5 * like->width / like->lens.fx();
    check->viewer = viewer_imager(viewer->imager_from_world.inverse(), like->width, like->height,
                                  360 / std::numbers::pi * std::atan(half));
  }
  if (viewpoints.size() > 1) check->shares = shared.shares;
  return {};
}

// Shifts the light of each named projector by a number of its pixels, as a push against it would.
void nudge(const ConfigNode& node, Rig* rig) {
  for (const std::string& name : node.keys()) {
    Imager* projector = find_named(rig->projectors, name);
    if (!projector) {
      node.at(name).problem(fmt::format("expected a projector of the world ({}), found '{}'.",
                                        joined_names(rig->projectors), name));
      continue;
    }
    std::vector<double> px = node.at(name).numbers(2);
    px.resize(2, 0);
    projector->lens.values[2] += px[0];  // the principal point
    projector->lens.values[3] += px[1];
  }
}

Hand read_hand(const ConfigNode& node, const Rig& rig) {
  node.only({"before", "at", "aim_m"});
  std::vector<std::string> names;
  for (const Imager& projector : rig.projectors) names.push_back(projector.name);
  Hand hand;
  const auto found = std::find(names.begin(), names.end(), node.at("before").choice(names));
  if (found != names.end()) hand.projector = static_cast<std::size_t>(found - names.begin());
  hand.p_target = node.at("aim_m").vector3();
  hand.at = node.at("at").positive();
  if (hand.at >= 1)
    node.at("at").problem(fmt::format("expected a share of the way below 1, found {}.", hand.at));
  return hand;
}

}  // namespace

const std::vector<CheckMeasure>& check_measures() {
  static const std::vector<CheckMeasure> measures = {
      {"texture_mm", "distance of surface light from where it was aimed, RMS", "mm"},
      {"parallax_mm", "points 50 mm off the surface, seen from the viewpoint, worst error", "mm"},
      {"shared_mm", "the same points, seen by the viewers who share the viewpoint, RMS", "mm"},
      {"shone_mean_255", "light on the prototype compared with the ray tracer, mean over lit pixels", "/255"},
      {"shone_over4_share", "light on the prototype, share of pixels more than 4/255 off", ""},
      {"shone_inner_over4_share",
       "light on the prototype away from edges, share of pixels more than 4/255 off", ""},
      {"drawn_mean_255", "parts over a camera image compared with the ray tracer, mean over their pixels",
       "/255"},
      {"drawn_over4_share", "parts over a camera image, share of pixels more than 4/255 off", ""},
      {"drawn_inner_over4_share",
       "parts over a camera image away from edges, share of pixels more than 4/255 off", ""},
      {"mask_iou", "on/off-surface masks, overlap with the ray tracer's (IoU)", "", true},
      {"spill_share", "share of the light that falls where no part needs it", ""},
      {"composite_px", "outlines over a camera image, RMS of the worst part", "px"},
      {"edge_gap_share", "part's light missing where light meets screen, 95 % quantile", ""},
      {"edge_double_share", "part's light shown twice where light meets screen, 95 % quantile", ""},
      {"depth_order_share", "share of pixels with parts and prototype in the right order", "", true},
      {"seam_step_p95", "luminance step along projectors' seams, 95 % quantile", ""},
      {"seam_step_max", "luminance step anywhere, largest", ""},
      {"black_step_share", "step of the black light, as a share of one projector's, worst", ""},
      {"refill_share", "share of the light lost to a hand's shadow that is filled within 3 frames", "", true},
      {"refill_flash_share", "light above that without the hand, as a share of it, worst", ""},
      {"refill_still_255", "change of the projectors' images over 30 frames without a hand", "/255"},
      {"rerun_worst_255", "difference of two runs, worst", "/255"},
  };
  return measures;
}

Result<Check> load_check(const fs::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.check/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "about", "world", "scene", "poses", "viewer", "resolution", "nudge", "hand", "clay",
             "limits"});
  Check check;
  check.name = path.stem().string();
  check.about = root.at("about").text();
  const fs::path world_file = (config.folder() / root.at("world").text()).lexically_normal();
  check.limits = read_limits(root.at("limits"));
  std::vector<Viewer> viewers;
  if (const auto node = root.find("viewer")) viewers = read_viewers(*node);
  const auto scene = root.find("scene");
  const std::string scene_folder = scene ? scene->text() : "";
  LIMN_TRY_STATUS(config.status());

  LIMN_TRY(check.truth, sim::load_world(world_file, tracker::marker_image));
  if (!scene_folder.empty()) {
    LIMN_TRY(scene::Scene other,
             scene::load_usable_scene((config.folder() / scene_folder).lexically_normal()));
    replace_scene(std::move(other), &check.truth);
  }
  if (!check.truth.scene || !check.truth.scene->prototype) {
    return error(
        "{}: world: expected a world or a scene with a prototype to project on, found none. Add scene.",
        path.string());
  }
  LIMN_TRY(check.posed, poses_of(root.find("poses"), config.folder(), &check.truth));
  if (const auto node = root.find("resolution")) coarsen(*node, &check.truth.rig);
  if (const auto node = root.find("hand")) check.hand = read_hand(*node, check.truth.rig);
  if (const auto node = root.find("clay")) {
    const Eigen::Vector3d rgb = node->vector3();
    if (sim::Object* prototype = check.truth.find("prototype")) prototype->albedo = rgb.reverse();
  }
  check.renderer_input = {check.truth.rig, *check.truth.scene, check.posed};
  if (const Status chosen = choose_viewer(viewers, &check); !chosen)
    return error("{}: {}", path.string(), chosen.message());
  if (const auto node = root.find("nudge")) nudge(*node, &check.truth.rig);
  LIMN_TRY_STATUS(config.status());
  return check;
}

}  // namespace limn::validate
