#include "remote/api/state.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/config.h"
#include "scene/command_text.h"
#include "scene/volume_part.h"

namespace limn::remote {
namespace {

constexpr double k_same_m = 0.05e-3, k_same_rad = 0.03 * std::numbers::pi / 180;
constexpr std::size_t k_max_notes = 20;

std::string tracking_name(const std::vector<Track>& tracks, const std::string& body) {
  for (const Track& track : tracks) {
    if (track.body != body || track.tracking == TrackingState::lost) continue;
    return track.tracking == TrackingState::measured ? "seen" : "carried on";
  }
  return "lost";
}

SessionState::Slot slot_state(const session::Session& session, std::size_t index) {
  const scene::Scene& scene = session.setup().scene;
  const scene::Slot& slot = scene.slots[index];
  const scene::ShowState::Slot& staged = session.show_state().slots[index];
  SessionState::Slot out;
  out.name = slot.name;
  out.variant = staged.variant;
  for (const scene::Variant& variant : slot.variants) {
    out.variants.push_back(variant.name);
    if (variant.auto_imported) out.dropped.push_back(variant.name);
    if (variant.volume && variant.name == staged.variant)
      out.volume = {variant.volume->least, variant.volume->most, scene::shown_window(variant, staged.window)};
  }
  out.nudge_mm = 1e3 * staged.nudge;
  out.is_held = staged.pin || !staged.nudge.isZero();
  out.tracking = tracking_name(session.composed().tracks, slot.name);
  out.marker = scene::slot_marker(scene, session.show_state(), index).text();
  out.material = scene::format_material_override(staged.material);
  const scene::PosedScene& posed = session.composed().posed;
  const Pose from_world = posed.world_from_prototype ? posed.world_from_prototype->inverse() : Pose{};
  for (const scene::PosedPart& part : posed.parts)
    if (part.slot == slot.name) out.prototype_from_part = from_world * part.world_from_part;
  return out;
}

std::string light_text(const scene::Scene& scene, const scene::ShowState& show_state) {
  if (!show_state.light || show_state.light == scene.light) return {};
  const auto numbers = scene::room_light_numbers(*show_state.light, show_state.d_front_world);
  if (!numbers) return "other";
  return fmt::format("{:g} {:g} {:g} {:g} {:g}", (*numbers)[0], (*numbers)[1], (*numbers)[2], (*numbers)[3],
                     (*numbers)[4]);
}

// Rounded to three decimals, for short messages.
double rounded(double value) { return std::round(1e3 * value) / 1e3; }

nlohmann::ordered_json to_json(const SessionState::Slot& slot) {
  nlohmann::ordered_json out = {
      {"name", slot.name},
      {"variant", slot.variant},
      {"variants", slot.variants},
      {"nudge_mm", {rounded(slot.nudge_mm.x()), rounded(slot.nudge_mm.y()), rounded(slot.nudge_mm.z())}},
      {"is_held", slot.is_held},
      {"sight", slot.tracking},
      {"marker", slot.marker},
      {"material", slot.material},
      {"dropped", slot.dropped}};
  if (slot.volume)
    out["volume"] = {{"least", slot.volume->least},
                     {"most", slot.volume->most},
                     {"window", scene::format_grey_window(slot.volume->window)}};
  if (slot.prototype_from_part) out["prototype_from_part"] = limn::to_json(*slot.prototype_from_part);
  return out;
}

SessionState::Deviation deviation_state(const session::Session& session) {
  const session::DeviationStatus& status = session.deviation();
  const scene::DeviationChoice& choice = session.show_state().deviation;
  SessionState::Deviation out{.progress = status.progress,
                              .text = status.text,
                              .report = status.report.string(),
                              .is_shown = choice.is_shown,
                              .is_held = choice.is_held,
                              .is_fitted = choice.fit_box.has_value(),
                              .tolerance_mm = 1e3 * choice.tolerance_m,
                              .extremes = {}};
  if (choice.layer) out.extremes = choice.layer->marks;
  return out;
}

nlohmann::ordered_json to_json(const SessionState::Deviation& deviation) {
  nlohmann::ordered_json out = {{"progress", deviation.progress},
                                {"text", deviation.text},
                                {"report", deviation.report},
                                {"is_shown", deviation.is_shown},
                                {"is_held", deviation.is_held},
                                {"is_fitted", deviation.is_fitted},
                                {"tolerance_mm", rounded(deviation.tolerance_mm)}};
  out["extremes"] = nlohmann::ordered_json::array();
  for (const scene::DeviationLayer::Mark& mark : deviation.extremes) {
    const Eigen::Vector3d mm = 1e3 * mark.p_prototype;
    out["extremes"].push_back({{"mm", rounded(1e3 * mark.distance_m)},
                               {"at_mm", {rounded(mm.x()), rounded(mm.y()), rounded(mm.z())}}});
  }
  return out;
}

}  // namespace

SessionState session_state(const session::Session& session,
                           const session::Telemetry& telemetry,
                           const session::DeviceHealth& health,
                           Stamp begun_at) {
  const scene::Scene& scene = session.setup().scene;
  const scene::ShowState& show_state = session.show_state();
  SessionState out;
  for (std::size_t i = 0; i < scene.slots.size(); ++i) out.slots.push_back(slot_state(session, i));
  if (scene.prototype) out.prototype = tracking_name(session.composed().tracks, "prototype");
  for (const scene::Look& look : show_state.looks) out.looks.push_back(look.name);
  out.look = show_state.look;
  out.other_look = show_state.other_look;
  if (show_state.deleted_look) out.deleted_look = show_state.deleted_look->name;
  out.blackout = show_state.blackout;
  out.frozen = show_state.frozen;
  out.grid = show_state.grid;
  out.marker_states = show_state.marker_states;
  out.split = show_state.split;
  out.split_mm = show_state.split_mm;
  out.screen = scene::screen_names()[static_cast<std::size_t>(show_state.screen)];
  out.outputs = show_state.screens;
  out.finishes = scene::finish_names(scene);
  out.finish = show_state.finish;
  if (scene.section) out.section = show_state.section;
  for (const scene::Line& line : scene.lines) out.lines.push_back(line.name);
  for (const scene::DrawnLine& line : show_state.drawn) {
    out.lines.push_back(line.name);
    out.lines_drawn.push_back(line.name);
  }
  out.lines_on = show_state.lines;
  out.light = light_text(scene, show_state);
  out.viewer = show_state.viewer;
  out.follows = session.composed().follows;
  out.repair = session.recalibration().progress;
  out.deviation = deviation_state(session);
  out.pace = session.pace();
  out.windows = {session.windows().begin(), session.windows().end()};
  for (const Imager& projector : session.setup().rig.projectors) out.projectors.push_back(projector.name);
  out.devices = health.all();
  for (const session::LooseMarker& loose : session::waiting_markers(scene, show_state, session.percepts()))
    out.waiting.push_back(loose.marker.text());
  const auto& notes = telemetry.notes();
  const double begun_s = seconds_of(begun_at);
  for (std::size_t i = notes.size() > k_max_notes ? notes.size() - k_max_notes : 0; i < notes.size(); ++i)
    out.notes.push_back({notes[i].first - begun_s, notes[i].second});
  out.last_edit = session.last_edit();
  return out;
}

SessionState without_jitter(SessionState state, const SessionState& published) {
  for (std::size_t i = 0; i < std::min(state.slots.size(), published.slots.size()); ++i) {
    auto& pose = state.slots[i].prototype_from_part;
    const auto& before = published.slots[i].prototype_from_part;
    if (pose && before && (pose->translation - before->translation).norm() <= k_same_m &&
        angle_between(pose->rotation, before->rotation) <= k_same_rad)
      pose = before;
  }
  return state;
}

nlohmann::ordered_json to_json(const SessionState& state) {
  nlohmann::ordered_json out;
  out["slots"] = nlohmann::ordered_json::array();
  for (const SessionState::Slot& slot : state.slots) out["slots"].push_back(to_json(slot));
  if (!state.prototype.empty()) out["prototype"] = state.prototype;
  out["looks"] = state.looks;
  out["look"] = state.look;
  out["other_look"] = state.other_look;
  out["deleted_look"] = state.deleted_look;
  out["blackout"] = state.blackout;
  out["frozen"] = state.frozen;
  out["grid"] = state.grid;
  out["marker_states"] = state.marker_states;
  out["split"] = state.split;
  out["split_mm"] = state.split_mm;
  out["finishes"] = state.finishes;
  out["finish"] = state.finish;
  if (state.section)
    out["section"] = {{"is_on", state.section->is_on},
                      {"is_held", state.section->is_held},
                      {"is_flipped", state.section->is_flipped}};
  out["lines"] = state.lines;
  out["lines_on"] = state.lines_on;
  out["lines_drawn"] = state.lines_drawn;
  out["light"] = state.light;
  out["screen"] = state.screen;
  out["screens"] = scene::screen_names();
  out["outputs"] = nlohmann::ordered_json::array();
  for (const scene::Output& output : state.outputs)
    out["outputs"].push_back(
        {{"name", output.name}, {"shows", scene::screen_names()[static_cast<std::size_t>(output.shows)]}});
  out["viewer"] = state.viewer;
  out["follows"] = state.follows;
  out["repair"] = state.repair;
  out["deviation"] = to_json(state.deviation);
  out["pace"] = state.pace;
  out["windows"] = state.windows;
  out["projectors"] = state.projectors;
  out["devices"] = nlohmann::ordered_json::array();
  for (const session::DeviceState& device : state.devices)
    out["devices"].push_back(
        {{"name", device.name}, {"kind", device.kind}, {"works", device.works}, {"why", device.why}});
  out["waiting"] = state.waiting;
  out["notes"] = nlohmann::ordered_json::array();
  for (const SessionState::Note& note : state.notes)
    out["notes"].push_back({{"at_s", rounded(note.at_s)}, {"text", note.text}});
  return out;
}

}  // namespace limn::remote
