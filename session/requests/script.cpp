#include "session/requests/script.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "core/config.h"
#include "core/names.h"

namespace limn::session {
namespace {

constexpr double k_never_s = 1e9;
constexpr double k_most_periods = 1000;
constexpr double k_largest_step_s = 1e6;
constexpr double k_hand_albedo = 0.35;
constexpr double k_hand_above_m = 0.006;
// A hand in a projector's light: its place as a share of the way to the prototype's middle, and its size.
constexpr double k_block_at = 0.6, k_block_width_m = 0.09, k_block_height_m = 0.18;

double time_of(const ConfigNode& node) {
  const double seconds = node.number();
  if (seconds < 0) node.problem(fmt::format("expected seconds (0 or more), found {}.", seconds));
  return seconds;
}

void read_span(const ConfigNode& node, double* from_s, double* until_s) {
  *from_s = time_of(node.at("at_s"));
  *until_s = time_of(node.at("until_s"));
  if (*until_s <= *from_s)
    node.at("until_s").problem("expected a time later than at_s, found an earlier one or the same.");
}

cv::Size size_of(const ConfigNode& node) {
  const auto [width, height] = node.image_size();
  return {width, height};
}

scene::Edit read_edit(const ConfigNode& node) {
  node.only({"action", "slot", "value"});
  scene::Edit edit{node.at("action").text(), "", ""};
  if (const auto slot = node.find("slot")) edit.slot = slot->text();
  if (const auto value = node.find("value")) edit.value = value->text();
  return edit;
}

void read_event(const ConfigNode& node, Script* script) {
  if (const auto marker = node.find("sway")) {
    node.only({"at_s", "until_s", "sway", "amplitude_m", "hz"});
    Script::Sway sway{marker->text(), 0, 0, node.at("amplitude_m").vector3(), 0.5};
    if (const auto hz = node.find("hz")) sway.hz = hz->positive();
    read_span(node, &sway.from_s, &sway.until_s);
    script->sways.push_back(sway);
  } else if (const auto moved = node.find("move")) {
    node.only({"at_s", "move", "home_from_marker"});
    script->moves.push_back({moved->text(), time_of(node.at("at_s")), node.at("home_from_marker").pose()});
  } else if (const auto covered = node.find("cover")) {
    node.only({"at_s", "until_s", "cover"});
    Script::Cover cover{covered->text(), 0, 0};
    read_span(node, &cover.from_s, &cover.until_s);
    script->covers.push_back(cover);
  } else if (const auto blocked = node.find("block")) {
    node.only({"at_s", "until_s", "block"});
    Script::Block block{blocked->text(), 0, 0};
    read_span(node, &block.from_s, &block.until_s);
    script->blocks.push_back(block);
  } else if (const auto device = node.find("unplug")) {
    node.only({"at_s", "until_s", "unplug"});
    Script::Unplug unplug{device->text(), 0, 0};
    read_span(node, &unplug.from_s, &unplug.until_s);
    script->unplugs.push_back(unplug);
  } else if (const auto nudged = node.find("nudge")) {
    node.only({"at_s", "until_s", "nudge", "degrees", "mm"});
    Script::Nudge nudge{nudged->text(), time_of(node.at("at_s")), k_never_s, {}};
    if (node.find("until_s")) read_span(node, &nudge.from_s, &nudge.until_s);
    if (const auto turn = node.find("degrees"))
      nudge.home_from_device.rotation = exp_rotation(turn->vector3() * std::numbers::pi / 180);
    if (const auto shift = node.find("mm")) nudge.home_from_device.translation = 1e-3 * shift->vector3();
    script->nudges.push_back(nudge);
  } else if (const auto resized = node.find("resize")) {
    node.only({"at_s", "until_s", "resize", "size"});
    Script::Resize resize{resized->text(), 0, 0, size_of(node.at("size"))};
    read_span(node, &resize.from_s, &resize.until_s);
    script->resizes.push_back(resize);
  } else if (const auto stepped = node.find("clock_step")) {
    node.only({"at_s", "clock_step", "seconds"});
    const double step_s = node.at("seconds").number();
    if (std::abs(step_s) > k_largest_step_s)
      node.at("seconds").problem(
          fmt::format("expected at most {} s in either direction, found {}.", k_largest_step_s, step_s));
    script->clock_steps.push_back({stepped->text(), time_of(node.at("at_s")), step_s});
  } else if (const auto edit = node.find("edit")) {
    node.only({"at_s", "edit"});
    script->edits.push_back({time_of(node.at("at_s")), read_edit(*edit)});
  } else {
    node.problem(
        "expected one of sway, move, cover, block, unplug, nudge, resize, clock_step, edit, found none of "
        "them.");
  }
}

Status in_room(const char* what, const std::string& name, const std::vector<std::string>& known) {
  if (std::find(known.begin(), known.end(), name) != known.end()) return {};
  return error("script: expected a {} that stands in the room ({}), found '{}'.", what, joined_names(known),
               name);
}

// Repeats the events every `period_s` until the end.
Script repeated(const Script& once, double period_s) {
  Script all;
  all.seconds = once.seconds;
  const auto later = [](const auto& events, double by_s, auto* out) {
    for (auto event : events) {
      if constexpr (requires { event.from_s; }) {
        event.from_s += by_s;
        event.until_s += by_s;
      } else {
        event.at_s += by_s;
      }
      out->push_back(std::move(event));
    }
  };
  for (double by_s = 0; by_s < once.seconds; by_s += period_s) {
    later(once.sways, by_s, &all.sways);
    later(once.moves, by_s, &all.moves);
    later(once.covers, by_s, &all.covers);
    later(once.blocks, by_s, &all.blocks);
    later(once.unplugs, by_s, &all.unplugs);
    later(once.nudges, by_s, &all.nudges);
    later(once.resizes, by_s, &all.resizes);
    later(once.clock_steps, by_s, &all.clock_steps);
    later(once.edits, by_s, &all.edits);
  }
  return all;
}

}  // namespace

bool Script::is_plugged(const std::string& device, double at_s) const {
  return std::none_of(unplugs.begin(), unplugs.end(), [&](const Unplug& u) {
    return u.device == device && at_s >= u.from_s && at_s < u.until_s;
  });
}

Result<Script> load_script(const std::filesystem::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.script/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "about", "seconds", "again_every_s", "events"});
  Script once;
  once.seconds = root.at("seconds").positive();
  for (const ConfigNode& node : root.at("events").items()) read_event(node, &once);
  double period_s = once.seconds;
  if (const auto again = root.find("again_every_s")) {
    period_s = again->positive();
    if (once.seconds > k_most_periods * period_s)
      again->problem(fmt::format("expected a period of at least {} s for a session of {} s, found {}.",
                                 once.seconds / k_most_periods, once.seconds, period_s));
  }
  LIMN_TRY_STATUS(config.status());
  Script script = repeated(once, period_s);
  std::stable_sort(script.edits.begin(), script.edits.end(),
                   [](const Script::Action& a, const Script::Action& b) { return a.at_s < b.at_s; });
  std::stable_sort(script.moves.begin(), script.moves.end(),
                   [](const Script::Move& a, const Script::Move& b) { return a.at_s < b.at_s; });
  return script;
}

Result<ScriptedRoom> ScriptedRoom::create(Script script, sim::VirtualRig* rig) {
  ScriptedRoom out;
  out.rig_ = rig;
  for (const sim::PlacedMarker& placed : rig->world().markers)
    out.homes_.push_back({placed, rig->world().find(placed.object)->world_from_object});
  std::vector<std::string> markers, cameras, projectors;
  for (const Home& home : out.homes_) markers.push_back(home.placed.marker.text());
  for (const Imager& camera : rig->world().rig.cameras) cameras.push_back(camera.name);
  for (const Imager& projector : rig->world().rig.projectors) projectors.push_back(projector.name);
  std::vector<std::string> devices = cameras;
  devices.insert(devices.end(), projectors.begin(), projectors.end());

  for (const auto& sway : script.sways) LIMN_TRY_STATUS(in_room("marker", sway.marker, markers));
  for (const auto& move : script.moves) LIMN_TRY_STATUS(in_room("marker", move.marker, markers));
  for (const auto& cover : script.covers) LIMN_TRY_STATUS(in_room("marker", cover.marker, markers));
  for (const auto& block : script.blocks) LIMN_TRY_STATUS(in_room("projector", block.projector, projectors));
  for (const auto& unplug : script.unplugs) LIMN_TRY_STATUS(in_room("device", unplug.device, devices));
  for (const auto& resize : script.resizes) LIMN_TRY_STATUS(in_room("camera", resize.camera, cameras));
  for (const auto& step : script.clock_steps) LIMN_TRY_STATUS(in_room("camera", step.camera, cameras));
  for (const auto& nudge : script.nudges) {
    LIMN_TRY_STATUS(in_room("device", nudge.device, devices));
    out.devices_.emplace_back(nudge.device, rig->world().rig.find(nudge.device)->imager_from_world);
  }
  out.script_ = std::move(script);
  return out;
}

const ScriptedRoom::Home& ScriptedRoom::home_of(const std::string& marker) const {
  return *std::find_if(homes_.begin(), homes_.end(),
                       [&](const Home& home) { return home.placed.marker.text() == marker; });
}

Pose ScriptedRoom::place_of(const Home& home, double at_s) const {
  const std::string marker = home.placed.marker.text();
  Pose home_from_marker;
  for (const Script::Move& move : script_.moves)
    if (move.marker == marker && at_s >= move.at_s) home_from_marker = move.home_from_marker;
  for (const Script::Sway& sway : script_.sways) {
    if (sway.marker != marker || at_s < sway.from_s) continue;
    const double swayed_s = std::min(at_s, sway.until_s) - sway.from_s;
    home_from_marker.translation += std::sin(2 * std::numbers::pi * sway.hz * swayed_s) * sway.amplitude_m;
  }
  return home.world_from_object * home_from_marker;
}

void ScriptedRoom::set(double at_s) {
  nudge(at_s);
  for (const Home& home : homes_) {
    const Pose place = place_of(home, at_s);
    if (!is_same(place, rig_->world().find(home.placed.object)->world_from_object))
      rig_->move(home.placed.object, place);
  }
  for (std::size_t i = 0; i < script_.covers.size(); ++i) {
    const Script::Cover& cover = script_.covers[i];
    put(fmt::format("cover{}", i), at_s >= cover.from_s && at_s < cover.until_s, [&] {
      const Home& home = home_of(cover.marker);
      const Pose above(Eigen::Quaterniond::Identity(), {0, 0, -k_hand_above_m});
      return sim::sheet({}, 2 * home.placed.size_m, 2 * home.placed.size_m, {}, place_of(home, at_s) * above);
    });
  }
  for (std::size_t i = 0; i < script_.blocks.size(); ++i) {
    const Script::Block& block = script_.blocks[i];
    put(fmt::format("block{}", i), at_s >= block.from_s && at_s < block.until_s, [&] {
      const Imager& projector = *rig_->world().rig.find(block.projector);
      const Eigen::Vector3d p_light = projector.imager_from_world.inverse().translation;
      const Eigen::Vector3d p_aim = rig_->world().world_from_prototype.translation;
      Pose place = looking_at(p_light, p_aim, Eigen::Vector3d::UnitZ()).inverse();
      place.translation = p_light + k_block_at * (p_aim - p_light);
      return sim::sheet({}, k_block_width_m, k_block_height_m, {}, place);
    });
  }
}

// Moves devices that are nudged, and puts back the others.
void ScriptedRoom::nudge(double at_s) {
  for (const auto& [name, imager_from_world] : devices_) {
    Pose place = imager_from_world;
    for (const Script::Nudge& nudge : script_.nudges)
      if (nudge.device == name && at_s >= nudge.from_s && at_s < nudge.until_s)
        place = nudge.home_from_device.inverse() * imager_from_world;
    if (is_same(place, rig_->world().rig.find(name)->imager_from_world)) continue;
    Rig& rig = rig_->edit().rig;
    for (std::vector<Imager>* imagers : {&rig.cameras, &rig.projectors})
      for (Imager& imager : *imagers)
        if (imager.name == name) imager.imager_from_world = place;
  }
}

// Adds a hand to the room or removes it. One that is not due is never created: there may be thousands.
void ScriptedRoom::put(const std::string& name, bool is_due, const std::function<sim::Object()>& hand) {
  const bool is_there = rig_->world().find(name) != nullptr;
  if (is_there && !is_due) rig_->remove(name);
  if (is_there == is_due || !is_due) return;
  sim::Object object = hand();
  object.name = name;
  object.albedo.setConstant(k_hand_albedo);
  rig_->place(object);
}

Frame ScriptedRoom::sent(Frame exposed, double at_s) const {
  for (const Script::Resize& resize : script_.resizes)
    if (resize.camera == exposed.camera && at_s >= resize.from_s && at_s < resize.until_s)
      cv::resize(exposed.image, exposed.image, resize.size, 0, 0, cv::INTER_AREA);
  double step_s = 0;
  for (const Script::ClockStep& step : script_.clock_steps)
    if (step.camera == exposed.camera && at_s >= step.at_s) step_s += step.step_s;
  exposed.captured_at = shifted(exposed.captured_at, step_s);
  return exposed;
}

Pose ScriptedRoom::world_from_marker(const MarkerName& marker, double at_s) const {
  return place_of(home_of(marker.text()), at_s);
}

}  // namespace limn::session
