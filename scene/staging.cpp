#include "scene/staging.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <sstream>

#include "core/config.h"

namespace limn::scene {
namespace {

constexpr double k_moved_m = 0.010, k_moved_rad = 5 * std::numbers::pi / 180;
constexpr double k_most_nudge_mm = 1000, k_most_split_mm = 5000, k_most_place_mm = 5000;
constexpr double k_least_quaternion = 0.5, k_most_quaternion = 2;  // its length, which is made 1

std::string listed(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list.empty() ? "none" : list;
}

std::vector<std::string> variant_names(const Slot& slot) {
  std::vector<std::string> names;
  for (const Variant& variant : slot.variants) names.push_back(variant.name);
  return names;
}

std::vector<std::string> look_names(const Staging& staging) {
  std::vector<std::string> names;
  for (const Look& look : staging.looks) names.push_back(look.name);
  return names;
}

const Track* find_shown(std::span<const Track> tracks, const std::string& body) {
  const auto found = std::find_if(tracks.begin(), tracks.end(), [&](const Track& track) {
    return track.body == body && track.sight != Sight::lost;
  });
  return found == tracks.end() ? nullptr : &*found;
}

// The element `steps` after `name`, round and round.
const std::string& stepped(const std::vector<std::string>& names, const std::string& name, int steps) {
  const auto found = std::find(names.begin(), names.end(), name);
  const int count = static_cast<int>(names.size());
  // Before the first one stands nothing: a step on leads to it, a step back to the last.
  const int at = found == names.end() ? (steps > 0 ? -1 : 0) : static_cast<int>(found - names.begin());
  return names[static_cast<std::size_t>(((at + steps) % count + count) % count)];
}

Result<bool> switched(bool is_on, const Edit& edit) {
  if (edit.value.empty() || edit.value == "toggle") return !is_on;
  if (edit.value == "on") return true;
  if (edit.value == "off") return false;
  return error("{}: expected on, off or toggle, found '{}'.", edit.action, edit.value);
}

Result<Eigen::Vector3d> millimetres(const Edit& edit) {
  std::istringstream text(edit.value);
  Eigen::Vector3d mm;
  std::string rest;
  if (!(text >> mm.x() >> mm.y() >> mm.z()) || text >> rest || !(mm.cwiseAbs().maxCoeff() <= k_most_nudge_mm))
    return error("nudge: expected three numbers of millimetres, at most {}, found '{}'.", k_most_nudge_mm,
                 edit.value);
  return mm;
}

Result<double> millimetre(const Edit& edit) {
  std::istringstream text(edit.value);
  double mm = 0;
  std::string rest;
  if (!(text >> mm) || text >> rest || !(std::abs(mm) <= k_most_split_mm))
    return error("{}: expected a number of millimetres, at most {}, found '{}'.", edit.action,
                 k_most_split_mm, edit.value);
  return mm;
}

Result<Pose> place_of(const Edit& edit) {
  std::istringstream text(edit.value);
  Eigen::Vector3d mm;
  Eigen::Quaterniond turn;
  std::string rest;
  if (!(text >> mm.x() >> mm.y() >> mm.z() >> turn.w() >> turn.x() >> turn.y() >> turn.z()) || text >> rest ||
      !(mm.cwiseAbs().maxCoeff() <= k_most_place_mm))
    return error(
        "place: expected x, y, z in millimetres, at most {}, and a quaternion w, x, y, z, found '{}'.",
        k_most_place_mm, edit.value);
  if (!(turn.norm() >= k_least_quaternion && turn.norm() <= k_most_quaternion))
    return error("place: expected a quaternion of length 1, found length {:.3g}.", turn.norm());
  return Pose(turn.normalized(), 1e-3 * mm);
}

bool is_file_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 && name.front() != '.' &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == ' ' || c == '.';
         });
}

std::string unused_look_name(const Staging& staging) {
  const std::vector<std::string> names = look_names(staging);
  for (int i = 1;; ++i) {
    const std::string name = fmt::format("look-{:02}", i);
    if (std::find(names.begin(), names.end(), name) == names.end()) return name;
  }
}

Pose prototype_from_world(const PosedScene& posed) {
  return posed.world_from_prototype ? posed.world_from_prototype->inverse() : Pose{};
}

void remember_look(const std::string& name, Staging* staging) {
  if (staging->look == name) return;
  staging->other_look = staging->look;
  staging->look = name;
}

Result<Staging> with_saved_look(const Scene& scene,
                                Staging staging,
                                const PosedScene& posed,
                                const Edit& edit) {
  Look look;
  look.name = edit.value.empty() ? unused_look_name(staging) : edit.value;
  if (!is_file_name(look.name))
    return error("save_look: expected a name of letters, digits, blanks, '-', '_' and '.', found '{}'.",
                 look.name);
  for (const PosedPart& part : posed.parts)
    look.parts.push_back(
        {part.slot, part.variant, prototype_from_world(posed) * part.world_from_part, part.material});
  look.light = posed.light ? posed.light : scene.light;
  remember_look(look.name, &staging);
  std::erase_if(staging.looks, [&](const Look& known) { return known.name == look.name; });
  staging.looks.push_back(std::move(look));
  return staging;
}

Result<Staging> with_look(const Scene& scene,
                          Staging staging,
                          const std::string& action,
                          const std::string& name) {
  const auto look = std::find_if(staging.looks.begin(), staging.looks.end(),
                                 [&](const Look& known) { return known.name == name; });
  if (look == staging.looks.end())
    return error("{}: expected one of {}, found '{}'.", action, listed(look_names(staging)), name);
  for (const Look::Part& part : look->parts) {
    for (std::size_t i = 0; i < scene.slots.size(); ++i) {
      if (scene.slots[i].name != part.slot) continue;
      staging.slots[i].variant = part.variant;
      staging.slots[i].pin = Pin{part.prototype_from_part, std::nullopt};
      staging.slots[i].material = part.material;
    }
  }
  staging.light = look->light;
  remember_look(name, &staging);
  return staging;
}

Result<Staging> without_look(Staging staging, const Edit& edit) {
  const auto look = std::find_if(staging.looks.begin(), staging.looks.end(),
                                 [&](const Look& known) { return known.name == edit.value; });
  if (look == staging.looks.end())
    return error("delete_look: expected one of {}, found '{}'.", listed(look_names(staging)), edit.value);
  staging.deleted_look = std::move(*look);
  staging.looks.erase(look);
  if (staging.look == edit.value) staging.look.clear();
  if (staging.other_look == edit.value) {
    staging.other_look.clear();
    staging.split = false;
  }
  return staging;
}

Result<Staging> with_deleted_look(Staging staging) {
  if (!staging.deleted_look) return error("undelete_look: expected a look that was deleted, found none.");
  const std::vector<std::string> names = look_names(staging);
  if (std::find(names.begin(), names.end(), staging.deleted_look->name) != names.end())
    return error("undelete_look: expected no look of that name, found another '{}'. Delete it first.",
                 staging.deleted_look->name);
  staging.looks.push_back(std::move(*staging.deleted_look));
  staging.deleted_look.reset();
  return staging;
}

std::set<std::string> families_of(const Scene& scene) {
  std::set<std::string> families;
  for (const Body& body : bodies(scene))
    for (const BodyMarker& marker : body.markers) families.insert(marker.marker.family);
  return families;
}

// What else uses a marker, in words.
std::optional<std::string> user_of(const Scene& scene,
                                   const Staging& staging,
                                   const MarkerName& marker,
                                   std::size_t but_slot) {
  for (std::size_t i = 0; i < scene.slots.size(); ++i)
    if (i != but_slot && carrier(scene, staging, i) == marker) return "slot '" + scene.slots[i].name + "'";
  for (const Body& body : bodies(scene)) {
    if (scene.find_slot(body.name)) continue;
    for (const BodyMarker& known : body.markers)
      if (known.marker == marker) return body.name == "prototype" ? "the prototype" : "a viewer";
  }
  for (const Control& control : scene.controls)
    if (control.marker == marker) return "the control of " + control.action;
  return std::nullopt;
}

Result<Staging> with_screen(Staging staging, const Edit& edit) {
  const auto output = std::find_if(staging.screens.begin(), staging.screens.end(),
                                   [&](const Output& known) { return known.name == edit.slot; });
  if (!edit.slot.empty() && output == staging.screens.end()) {
    std::vector<std::string> outputs;
    for (const Output& known : staging.screens) outputs.push_back(known.name);
    return error("screen: expected a screen of the devices file ({}), or none for all, found '{}'.",
                 listed(outputs), edit.slot);
  }
  const Screen before = edit.slot.empty() ? staging.screen : output->shows;
  const std::vector<std::string>& names = screen_names();
  const std::string name = edit.value.empty() || edit.value == "next"
                               ? stepped(names, names[static_cast<std::size_t>(before)], 1)
                               : edit.value;
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    return error("screen: expected one of {}, found '{}'.", listed(names), edit.value);
  const auto chosen = static_cast<Screen>(found - names.begin());
  if (!edit.slot.empty()) {
    output->shows = chosen;
    return staging;
  }
  staging.screen = chosen;
  for (Output& each : staging.screens) each.shows = chosen;
  return staging;
}

Status check_carrier(const Scene& scene, const Staging& staging, const MarkerName& marker, std::size_t slot) {
  const std::set<std::string> families = families_of(scene);
  if (!families.count(marker.family))
    return error("expected a marker of the scene's families ({}), found {}.",
                 listed({families.begin(), families.end()}), marker.text());
  if (const auto user = user_of(scene, staging, marker, slot))
    return error("expected a marker that carries nothing, found {}, which {} uses.", marker.text(), *user);
  return {};
}

Result<Staging> paired(const Scene& scene, std::size_t index, Staging staging, const Edit& edit) {
  if (edit.value.empty())
    return error(
        "pair: expected a marker that lies still and carries nothing, found none. Lay one down for a "
        "second.");
  auto marker = MarkerName::parse(edit.value);
  if (!marker) return error("{}: {}", edit.action, marker.message());
  if (const Status can = check_carrier(scene, staging, *marker, index); !can)
    return error("{}: {}", edit.action, can.message());
  Staging::Slot& slot = staging.slots[index];
  slot.pin.reset();
  if (*marker == scene.slots[index].marker)
    slot.marker.reset();
  else
    slot.marker = std::move(*marker);
  return staging;
}

// The pure part: the unit itself is kept beside the part's file.
Status check_units(const Slot& slot, const Edit& edit) {
  const auto blank = edit.value.rfind(' ');
  const std::string name = edit.value.substr(0, blank),
                    units = blank == std::string::npos ? "" : edit.value.substr(blank + 1);
  std::vector<std::string> dropped;
  for (const Variant& variant : slot.variants)
    if (variant.dropped) dropped.push_back(variant.name);
  if (std::find(dropped.begin(), dropped.end(), name) == dropped.end())
    return error("units: expected a part that was dropped into slot '{}' ({}) and its unit, found '{}'.",
                 slot.name, listed(dropped), edit.value);
  if (!metres_per_unit(units))
    return error("units: expected m, cm, mm, in or ft after the part's name, found '{}'.", units);
  return {};
}

Result<Staging> edited_slot(const Scene& scene, std::size_t index, Staging staging, const Edit& edit) {
  const Slot& slot = scene.slots[index];
  Staging::Slot& staged = staging.slots[index];
  const std::vector<std::string> names = variant_names(slot);
  if (edit.action == "next_variant") {
    staged.variant = stepped(names, staged.variant, 1);
  } else if (edit.action == "previous_variant") {
    staged.variant = stepped(names, staged.variant, -1);
  } else if (edit.action == "choose_variant") {
    if (std::find(names.begin(), names.end(), edit.value) == names.end())
      return error("choose_variant: expected a variant of slot '{}' ({}), found '{}'.", slot.name,
                   listed(names), edit.value);
    staged.variant = edit.value;
  } else if (edit.action == "nudge") {
    LIMN_TRY(const Eigen::Vector3d mm, millimetres(edit));
    staged.nudge += 1e-3 * mm;
    if (staged.pin)
      staged.pin->prototype_from_part =
          staged.pin->prototype_from_part * Pose(Eigen::Quaterniond::Identity(), 1e-3 * mm);
  } else if (edit.action == "place") {
    LIMN_TRY(const Pose prototype_from_part, place_of(edit));
    staged.nudge.setZero();
    staged.pin = Pin{prototype_from_part, std::nullopt};
  } else if (edit.action == "pair") {
    return paired(scene, index, std::move(staging), edit);
  } else if (edit.action == "unpair") {
    return paired(scene, index, std::move(staging), {edit.action, edit.slot, slot.marker.text()});
  } else if (edit.action == "units") {
    LIMN_TRY_STATUS(check_units(slot, edit));
  } else if (edit.action == "material") {
    LIMN_TRY(staged.material, material_change_of(edit.value));
  } else {  // release
    staged.nudge.setZero();
    staged.pin.reset();
  }
  return staging;
}

}  // namespace

const std::vector<std::string>& screen_names() {
  static const std::vector<std::string> names = {"rest", "full", "camera", "view", "stereo", "off"};
  return names;
}

Staging first_staging(const Scene& scene) {
  Staging staging;
  for (const Slot& slot : scene.slots) staging.slots.push_back({slot.variants.front().name, {}, {}, {}});
  for (Staging::Slot& slot : staging.slots) slot.nudge.setZero();
  return staging;
}

const std::vector<Action>& actions() {
  using enum Takes;
  static const std::vector<Action> all = {
      {"next_variant", true, nothing, "", "the slot's next variant"},
      {"previous_variant", true, nothing, "", "the slot's previous variant"},
      {"choose_variant", true, text, "a variant", "a variant by name"},
      {"nudge", true, millimetres, "three numbers, mm", "moves the part along its own axes"},
      {"place", true, Takes::pose, "x, y, z in mm; quaternion w, x, y, z",
       "puts the part there on the prototype, until its marker is moved"},
      {"release", true, nothing, "", "the part follows its marker again, without nudges"},
      {"pair", true, maybe_text, "a marker; empty: the one that glows",
       "the part is carried by that marker from now on"},
      {"unpair", true, nothing, "", "the scene's own marker carries the part again"},
      {"units", true, text, "a variant and m, cm, mm, in or ft", "the unit of a part that was dropped in"},
      {"material", true, maybe_text, "a colour, metalness, roughness, - for the file's: #c02818 0 0.4",
       "the part's material, of every variant; empty: as its file says"},
      {"save_look", false, maybe_text, "a name; empty: look-01 and so on",
       "keeps variants, places, materials and light, as JSON and PNG"},
      {"restore_look", false, text, "a look", "shows a look until its markers are moved"},
      {"next_look", false, nothing, "", "the look after the one last shown"},
      {"previous_look", false, nothing, "", "the look before it"},
      {"flip", false, maybe_text, "a look; empty: the one shown before", "shows the other of two looks"},
      {"split", false, on_off, "on, off or toggle", "left of a line the look shown before"},
      {"split_at", false, number, "mm to the right of the prototype's middle", "where that line is"},
      {"delete_look", false, text, "a look", "forgets a look"},
      {"undelete_look", false, nothing, "", "brings back the look that was last deleted"},
      {"repair", false, nothing, "",
       "patterns on the prototype for some 15 s: the session goes on with a rig that knows what was nudged"},
      {"light", false, maybe_text,
       "a lamp's degrees right and up, its strength, soft light above and below: 30 45 0.6 0.3 0.1",
       "the light that parts are shaded by, as seen from camera 0; empty: the scene's own"},
      {"blackout", false, on_off, "on, off or toggle", "bare model: no light"},
      {"freeze", false, on_off, "on, off or toggle", "what is shown stays"},
      {"grid", false, on_off, "on, off or toggle", "lines on the prototype, every 10 mm"},
      {"marker_states", false, on_off, "on, off or toggle",
       "rings around markers: green seen, amber carried on"},
      {"screen", false, maybe_text, "rest, full, camera, view, stereo, off or next",
       "what screens show, or the one that is named", "a screen; left out: all"},
      {"viewer", false, maybe_text, "a guest's name; empty: the scene's own viewer",
       "whose eye view parts are drawn for: a guest's tablet while its window sees markers"},
  };
  return all;
}

Result<Staging> edited(const Scene& scene,
                       const Staging& staging,
                       const PosedScene& posed,
                       const Edit& edit) {
  const auto action = std::find_if(actions().begin(), actions().end(),
                                   [&](const Action& a) { return a.name == edit.action; });
  if (action == actions().end()) {
    std::vector<std::string> names;
    for (const Action& known : actions()) names.push_back(known.name);
    return error("edit: expected an action ({}), found '{}'.", listed(names), edit.action);
  }
  if (action->of_slot) {
    for (std::size_t i = 0; i < scene.slots.size(); ++i)
      if (scene.slots[i].name == edit.slot) return edited_slot(scene, i, staging, edit);
    std::vector<std::string> names;
    for (const Slot& slot : scene.slots) names.push_back(slot.name);
    return error("{}: expected a slot of the scene ({}), found '{}'.", edit.action, listed(names), edit.slot);
  }
  Staging out = staging;
  if (edit.action == "save_look") return with_saved_look(scene, std::move(out), posed, edit);
  if (edit.action == "restore_look") return with_look(scene, std::move(out), edit.action, edit.value);
  if (edit.action == "next_look" || edit.action == "previous_look") {
    if (staging.looks.empty()) return error("{}: expected a saved look, found none. Save one.", edit.action);
    const int step = edit.action == "next_look" ? 1 : -1;
    return with_look(scene, std::move(out), edit.action, stepped(look_names(staging), staging.look, step));
  }
  if (edit.action == "flip") {
    if (edit.value.empty() && staging.other_look.empty())
      return error("flip: expected two looks shown before, found {}. Save or restore another.",
                   staging.look.empty() ? "none" : "one");
    return with_look(scene, std::move(out), edit.action,
                     edit.value.empty() ? staging.other_look : edit.value);
  }
  if (edit.action == "split_at") {
    LIMN_TRY(out.split_mm, millimetre(edit));
    return out;
  }
  if (edit.action == "split") {
    LIMN_TRY(out.split, switched(staging.split, edit));
    if (out.split && staging.other_look.empty())
      return error("split: expected a look shown before the present one, found none. Save or restore two.");
    return out;
  }
  if (edit.action == "light") {
    out.light.reset();
    if (edit.value.empty()) return out;
    LIMN_TRY(out.light, room_light_of(edit.value, scene.light ? scene.light->d_up_world : staging.d_up_world,
                                      staging.d_front_world));
    return out;
  }
  if (edit.action == "delete_look") return without_look(std::move(out), edit);
  if (edit.action == "undelete_look") return with_deleted_look(std::move(out));
  if (edit.action == "repair") {  // by the session's devices
    if (!staging.blackout) return out;
    return error("repair: expected light, found blackout. End the blackout first.");
  }
  if (edit.action == "screen") return with_screen(std::move(out), edit);
  if (edit.action == "viewer") {
    out.viewer = edit.value;
    return out;
  }
  bool Staging::*const flag = edit.action == "blackout" ? &Staging::blackout
                              : edit.action == "freeze" ? &Staging::frozen
                              : edit.action == "grid"   ? &Staging::grid
                                                        : &Staging::marker_states;
  LIMN_TRY(out.*flag, switched(staging.*flag, edit));
  return out;
}

Screen shown_on(const Staging& staging, const std::string& screen) {
  for (const Output& output : staging.screens)
    if (output.name == screen) return output.shows;
  return staging.screen;
}

const MarkerName& carrier(const Scene& scene, const Staging& staging, std::size_t slot) {
  return staging.slots[slot].marker ? *staging.slots[slot].marker : scene.slots[slot].marker;
}

std::vector<Track> carried(const Scene& scene, const Staging& staging, std::span<const Track> tracks) {
  std::vector<Track> out;
  for (const Track& track : tracks) {
    const Slot* own = scene.find_slot(track.body);
    bool is_taken = false;
    for (std::size_t i = 0; i < scene.slots.size(); ++i) {
      const MarkerName& marker = carrier(scene, staging, i);
      if (own ? own->marker != marker : track.body != loose_body(marker)) continue;
      out.push_back(track);
      out.back().body = scene.slots[i].name;
      is_taken = true;
    }
    if (!own && !is_taken) out.push_back(track);
  }
  return out;
}

std::optional<Staging> left_of_split(const Scene& scene, const Staging& staging) {
  if (!staging.split) return std::nullopt;
  auto left = with_look(scene, staging, "split", staging.other_look);
  if (!left) return std::nullopt;
  return std::move(*left);
}

std::string pairings_json(const Scene& scene, const Staging& staging) {
  nlohmann::ordered_json slots = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < scene.slots.size(); ++i)
    if (staging.slots[i].marker) slots[scene.slots[i].name] = staging.slots[i].marker->text();
  if (slots.empty()) return {};
  return nlohmann::ordered_json({{"schema", "limn.pairings/1"}, {"slots", slots}}).dump(2) + "\n";
}

Result<Staging> with_pairings(const std::filesystem::path& path, const Scene& scene, Staging staging) {
  LIMN_TRY(const Config config, Config::load(path, "limn.pairings/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "slots"});
  const ConfigNode slots = root.at("slots");
  for (const std::string& name : slots.keys()) {
    const Slot* slot = scene.find_slot(name);
    const auto marker = MarkerName::parse(slots.at(name).text());
    if (!slot) slots.at(name).problem("expected a slot of the scene, found another name.");
    if (!marker) slots.at(name).problem(marker.message());
    if (slot && marker) staging.slots[static_cast<std::size_t>(slot - scene.slots.data())].marker = *marker;
  }
  for (std::size_t i = 0; i < scene.slots.size(); ++i)  // all together: they may have changed places
    if (const auto& marker = staging.slots[i].marker)
      if (const Status can = check_carrier(scene, staging, *marker, i); !can)
        slots.at(scene.slots[i].name).problem(can.message());
  LIMN_TRY_STATUS(config.status());
  return staging;
}

Staging unpinned(const Scene& scene, const Staging& staging, std::span<const Track> tracks) {
  Staging out = staging;
  const Track* prototype = find_shown(tracks, "prototype");
  if (scene.prototype && !prototype) return out;
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    std::optional<Pin>& pin = out.slots[i].pin;
    const Track* track = pin ? find_shown(tracks, scene.slots[i].name) : nullptr;
    if (!track) continue;
    const Pose from_world = prototype ? prototype->world_from_body.inverse() : Pose{};
    const Pose now = from_world * track->world_from_body;
    if (!pin->prototype_from_marker) {
      pin->prototype_from_marker = now;
      continue;
    }
    const Pose& then = *pin->prototype_from_marker;
    if ((now.translation - then.translation).norm() > k_moved_m ||
        angle_between(now.rotation, then.rotation) > k_moved_rad)
      pin.reset();
  }
  return out;
}

PosedScene staged(const Scene& scene, const Staging& staging, std::span<const Track> tracks) {
  std::vector<std::string> variants;
  for (const Staging::Slot& slot : staging.slots) variants.push_back(slot.variant);
  PosedScene out = posed(scene, tracks, variants);
  const bool has_base = out.world_from_prototype.has_value() || !scene.prototype;
  const Pose world_from_base = out.world_from_prototype.value_or(Pose{});
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    const Staging::Slot& slot = staging.slots[i];
    const auto part = std::find_if(out.parts.begin(), out.parts.end(),
                                   [&](const PosedPart& p) { return p.slot == scene.slots[i].name; });
    if (slot.pin && has_base) {
      const PosedPart pinned{scene.slots[i].name, slot.variant,
                             world_from_base * slot.pin->prototype_from_part};
      if (part == out.parts.end())
        out.parts.push_back(pinned);
      else
        *part = pinned;
    } else if (part != out.parts.end()) {
      part->world_from_part = part->world_from_part * Pose(Eigen::Quaterniond::Identity(), slot.nudge);
    }
  }
  for (PosedPart& part : out.parts)
    part.material =
        staging.slots[static_cast<std::size_t>(scene.find_slot(part.slot) - scene.slots.data())].material;
  out.light = staging.light;
  return out;
}

std::string look_json(const Look& look) {
  nlohmann::ordered_json json = {{"schema", "limn.look/1"}, {"name", look.name}};
  json["slots"] = nlohmann::ordered_json::object();
  for (const Look::Part& part : look.parts) {
    nlohmann::ordered_json& slot = json["slots"][part.slot];
    slot = {{"variant", part.variant}, {"prototype_from_part", to_json(part.prototype_from_part)}};
    if (!part.material.is_none()) slot["material"] = to_json(part.material);
  }
  if (look.light) json["light"] = to_json(*look.light);
  return json.dump(2) + "\n";
}

Result<Look> load_look(const std::filesystem::path& path, const Scene& scene) {
  LIMN_TRY(const Config config, Config::load(path, "limn.look/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "name", "slots", "light"});
  Look look;
  look.name = root.at("name").text();
  if (!is_file_name(look.name))
    root.at("name").problem(fmt::format("expected a name, found '{}'.", look.name));
  const ConfigNode slots = root.at("slots");
  for (const std::string& name : slots.keys()) {
    const ConfigNode node = slots.at(name);
    node.only({"variant", "prototype_from_part", "material"});
    const Slot* slot = scene.find_slot(name);
    if (!slot) {
      node.problem("expected a slot of the scene, found another name.");
      break;
    }
    look.parts.push_back(
        {name, node.at("variant").choice(variant_names(*slot)), node.at("prototype_from_part").pose()});
    if (const auto material = node.find("material"))
      look.parts.back().material = read_material_change(*material);
  }
  if (const auto light = root.find("light")) look.light = read_room_light(*light);
  LIMN_TRY_STATUS(config.status());
  return look;
}

}  // namespace limn::scene
