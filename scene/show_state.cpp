#include "scene/show_state.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "core/config.h"
#include "core/json_text.h"
#include "core/names.h"
#include "scene/actions.h"
#include "scene/command_text.h"
#include "scene/volume_part.h"

namespace limn::scene {
namespace {

constexpr double k_moved_m = 0.010, k_moved_rad = 5 * std::numbers::pi / 180;
std::vector<std::string> variant_names(const Slot& slot) {
  std::vector<std::string> names;
  for (const Variant& variant : slot.variants) names.push_back(variant.name);
  return names;
}

const Track* find_shown(std::span<const Track> tracks, const std::string& body) {
  const auto found = std::find_if(tracks.begin(), tracks.end(), [&](const Track& track) {
    return track.body == body && track.tracking != TrackingState::lost;
  });
  return found == tracks.end() ? nullptr : &*found;
}

std::set<std::string> families_of(const Scene& scene) {
  std::set<std::string> families;
  for (const Body& body : bodies(scene))
    for (const BodyMarker& marker : body.markers) families.insert(marker.marker.family);
  return families;
}

// A description of what else uses a marker, for messages.
std::optional<std::string> user_of(const Scene& scene,
                                   const ShowState& show_state,
                                   const MarkerName& marker,
                                   std::size_t but_slot) {
  for (std::size_t i = 0; i < scene.slots.size(); ++i)
    if (i != but_slot && slot_marker(scene, show_state, i) == marker)
      return "slot '" + scene.slots[i].name + "'";
  for (const Body& body : bodies(scene)) {
    if (scene.find_slot(body.name)) continue;
    for (const BodyMarker& known : body.markers)
      if (known.marker == marker)
        return body.name == "prototype"      ? "the prototype"
               : body.name == section_body() ? "the section"
               : body.name == pen_body()     ? "the pen"
                                             : "a viewer";
  }
  for (const Control& control : scene.controls)
    if (control.marker == marker) return "the control of " + std::string(action_of(control.action).name);
  return std::nullopt;
}

}  // namespace

const std::vector<std::string>& screen_names() {
  static const std::vector<std::string> names = {"rest", "full", "camera", "view", "stereo", "off"};
  return names;
}

ShowState initial_show_state(const Scene& scene) {
  ShowState show_state;
  for (const Slot& slot : scene.slots) show_state.slots.push_back({slot.variants.front().name, {}, {}, {}});
  for (ShowState::Slot& slot : show_state.slots) slot.nudge.setZero();
  show_state.lines = first_lines(scene);
  return show_state;
}

std::vector<std::string> look_names(const ShowState& show_state) {
  std::vector<std::string> names;
  for (const Look& look : show_state.looks) names.push_back(look.name);
  return names;
}

bool is_look_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 && name.front() != '.' &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == ' ' || c == '.';
         });
}

const Look* find_look(const ShowState& show_state, const std::string& name) {
  return find_named(show_state.looks, name);
}

void remember_look(const std::string& name, ShowState* show_state) {
  if (show_state->look == name) return;
  show_state->other_look = show_state->look;
  show_state->look = name;
}

ShowState with_look(const Scene& scene, ShowState show_state, const Look& look) {
  for (const Look::Part& part : look.parts) {
    for (std::size_t i = 0; i < scene.slots.size(); ++i) {
      if (scene.slots[i].name != part.slot) continue;
      show_state.slots[i].variant = part.variant;
      show_state.slots[i].pin = Pin{part.prototype_from_part, std::nullopt};
      show_state.slots[i].material = part.material;
      show_state.slots[i].window = part.window;
    }
  }
  show_state.light = look.light;
  const bool has_finish =
      find_named(scene.finishes, look.finish) != nullptr;  // it may have been removed since
  show_state.finish = has_finish ? look.finish : "";
  if (look.cut && scene.section) {
    show_state.section.is_on = show_state.section.is_held = true;
    show_state.section.plane = look.cut;
  } else {
    show_state.section = changed(show_state.section, SectionChange::off);
  }
  show_state.lines = look.lines.value_or(first_lines(scene));
  for (const DrawnLine& line : look.drawn) {
    std::erase_if(show_state.drawn, [&](const DrawnLine& known) { return known.name == line.name; });
    show_state.drawn.push_back(line);
  }
  std::erase_if(show_state.lines, [&](const std::string& name) {  // it may have been removed since
    return !find_named(scene.lines, name) && !find_named(show_state.drawn, name);
  });
  remember_look(look.name, &show_state);
  return show_state;
}

std::vector<DrawnLine> shown_drawn_lines(const ShowState& show_state) {
  std::vector<DrawnLine> shown;
  for (const DrawnLine& line : show_state.drawn)
    if (line.curve.points.size() >= 2 &&
        std::find(show_state.lines.begin(), show_state.lines.end(), line.name) != show_state.lines.end())
      shown.push_back(line);
  return shown;
}

Screen screen_content(const ShowState& show_state, const std::string& screen) {
  const Output* output = find_named(show_state.screens, screen);
  return output ? output->shows : show_state.screen;
}

const MarkerName& slot_marker(const Scene& scene, const ShowState& show_state, std::size_t slot) {
  return show_state.slots[slot].marker ? *show_state.slots[slot].marker : scene.slots[slot].marker;
}

Status check_carrier(const Scene& scene,
                     const ShowState& show_state,
                     const MarkerName& marker,
                     std::size_t slot) {
  const std::set<std::string> families = families_of(scene);
  if (!families.count(marker.family))
    return error("expected a marker of the scene's families ({}), found {}.",
                 listed({families.begin(), families.end()}), marker.text());
  if (const auto user = user_of(scene, show_state, marker, slot))
    return error("expected a marker that carries nothing, found {}, which {} uses.", marker.text(), *user);
  return {};
}

std::vector<Track> assign_tracks(const Scene& scene,
                                 const ShowState& show_state,
                                 std::span<const Track> tracks) {
  std::vector<Track> out;
  for (const Track& track : tracks) {
    const Slot* own = scene.find_slot(track.body);
    bool is_taken = false;
    for (std::size_t i = 0; i < scene.slots.size(); ++i) {
      const MarkerName& marker = slot_marker(scene, show_state, i);
      if (own ? own->marker != marker : track.body != loose_body(marker)) continue;
      out.push_back(track);
      out.back().body = scene.slots[i].name;
      is_taken = true;
    }
    if (!own && !is_taken) out.push_back(track);
  }
  return out;
}

std::optional<ShowState> left_of_split(const Scene& scene, const ShowState& show_state) {
  if (!show_state.split) return std::nullopt;
  const Look* other = find_look(show_state, show_state.other_look);
  if (!other) return std::nullopt;
  return with_look(scene, show_state, *other);
}

std::string pairings_json(const Scene& scene, const ShowState& show_state) {
  nlohmann::ordered_json slots = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < scene.slots.size(); ++i)
    if (show_state.slots[i].marker) slots[scene.slots[i].name] = show_state.slots[i].marker->text();
  if (slots.empty()) return {};
  return json_text(nlohmann::ordered_json({{"schema", "limn.pairings/1"}, {"slots", slots}}), 2) + "\n";
}

Result<ShowState> with_pairings(const std::filesystem::path& path, const Scene& scene, ShowState show_state) {
  LIMN_TRY(const Config config, Config::load(path, "limn.pairings/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "slots"});
  const ConfigNode slots = root.at("slots");
  for (const std::string& name : slots.keys()) {
    const Slot* slot = scene.find_slot(name);
    const auto marker = MarkerName::parse(slots.at(name).text());
    if (!slot) slots.at(name).problem("expected a slot of the scene, found another name.");
    if (!marker) slots.at(name).problem(marker.message());
    if (slot && marker)
      show_state.slots[static_cast<std::size_t>(slot - scene.slots.data())].marker = *marker;
  }
  for (std::size_t i = 0; i < scene.slots.size();
       ++i)  // only after reading all, because slots may have exchanged markers
    if (const auto& marker = show_state.slots[i].marker)
      if (const Status can = check_carrier(scene, show_state, *marker, i); !can)
        slots.at(scene.slots[i].name).problem(can.message());
  LIMN_TRY_STATUS(config.status());
  return show_state;
}

ShowState without_moved_pins(const Scene& scene, const ShowState& show_state, std::span<const Track> tracks) {
  ShowState out = show_state;
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

// The plane of a track of the section's marker, in the world.
CutPlane plane_of(const Section& section, const SectionState& state, const Track& track) {
  const CutPlane plane = cut_plane(track.world_from_body * section.marker_from_plane);
  return state.is_flipped ? flipped(plane) : plane;
}

ShowState with_section_seen(const Scene& scene, ShowState show_state, std::span<const Track> tracks) {
  SectionState& state = show_state.section;
  if (!scene.section || !state.is_on || state.is_held) return show_state;
  const Track* track = find_shown(tracks, section_body());
  const Track* prototype = find_shown(tracks, "prototype");
  if (!track || track->tracking != TrackingState::measured || (scene.prototype && !prototype))
    return show_state;
  const Pose from_world = prototype ? prototype->world_from_body.inverse() : Pose{};
  state.plane = transformed(from_world, plane_of(*scene.section, state, *track));
  return show_state;
}

// The section's plane in the world.
std::optional<CutPlane> cut_of(const Scene& scene,
                               const SectionState& state,
                               std::span<const Track> tracks,
                               const std::optional<Pose>& world_from_base) {
  if (!scene.section || !state.is_on) return std::nullopt;
  const Track* track = state.is_held ? nullptr : find_shown(tracks, section_body());
  if (track && seconds_between(track->captured_at, track->at) <= k_section_follows_s)
    return plane_of(*scene.section, state, *track);
  if (!state.plane || !world_from_base) return std::nullopt;
  return transformed(*world_from_base, *state.plane);
}

PosedScene compose_scene(const Scene& scene, const ShowState& show_state, std::span<const Track> tracks) {
  std::vector<std::string> variants;
  for (const ShowState::Slot& slot : show_state.slots) variants.push_back(slot.variant);
  PosedScene out = posed(scene, tracks, variants);
  const bool has_base = out.world_from_prototype.has_value() || !scene.prototype;
  const Pose world_from_base = out.world_from_prototype.value_or(Pose{});
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    const ShowState::Slot& slot = show_state.slots[i];
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
  for (PosedPart& part : out.parts) {
    const ShowState::Slot& chosen =
        show_state.slots[static_cast<std::size_t>(scene.find_slot(part.slot) - scene.slots.data())];
    part.material = chosen.material;
    part.window = chosen.window;
  }
  out.light = show_state.light;
  out.finish = show_state.finish;
  out.cut =
      cut_of(scene, show_state.section, tracks, has_base ? std::optional(world_from_base) : std::nullopt);
  out.lines.clear();
  for (const std::string& name : show_state.lines)
    if (find_named(scene.lines, name)) out.lines.push_back(name);
  out.drawn = shown_drawn_lines(show_state);
  add_outlines(scene, &out);
  if (const DeviationChoice& deviation = show_state.deviation; deviation.is_shown && deviation.layer)
    out.deviation = {deviation.layer->number, deviation.tolerance_m};
  return out;
}

std::string look_json(const Look& look) {
  nlohmann::ordered_json json = {{"schema", "limn.look/1"}, {"name", look.name}};
  json["slots"] = nlohmann::ordered_json::object();
  for (const Look::Part& part : look.parts) {
    nlohmann::ordered_json& slot = json["slots"][part.slot];
    slot = {{"variant", part.variant}, {"prototype_from_part", to_json(part.prototype_from_part)}};
    if (!part.material.is_none()) slot["material"] = to_json(part.material);
    if (part.window) slot["window"] = to_json(*part.window);
  }
  if (!look.finish.empty()) json["finish"] = look.finish;
  if (look.lines) json["lines"] = *look.lines;
  for (const DrawnLine& line : look.drawn) json["drawn"].push_back(to_json(line));
  if (look.light) json["light"] = to_json(*look.light);
  if (look.cut) {
    const Eigen::Vector3d& n = look.cut->normal;
    json["cut"] = {{"normal", {n.x(), n.y(), n.z()}}, {"offset_mm", 1e3 * look.cut->offset_m}};
  }
  return json_text(json, 2) + "\n";
}

Result<Look> load_look(const std::filesystem::path& path, const Scene& scene) {
  LIMN_TRY(const Config config, Config::load(path, "limn.look/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "name", "slots", "light", "finish", "cut", "lines", "drawn"});
  Look look;
  look.name = root.at("name").text();
  if (!is_look_name(look.name))
    root.at("name").problem(fmt::format("expected a name, found '{}'.", look.name));
  const ConfigNode slots = root.at("slots");
  for (const std::string& name : slots.keys()) {
    const ConfigNode node = slots.at(name);
    node.only({"variant", "prototype_from_part", "material", "window"});
    const Slot* slot = scene.find_slot(name);
    if (!slot) {
      node.problem("expected a slot of the scene, found another name.");
      break;
    }
    look.parts.push_back(
        {name, node.at("variant").choice(variant_names(*slot)), node.at("prototype_from_part").pose()});
    if (const auto material = node.find("material"))
      look.parts.back().material = read_material_override(*material);
    if (const auto window = node.find("window")) look.parts.back().window = read_grey_window(*window);
  }
  if (const auto light = root.find("light")) look.light = read_room_light(*light);
  if (const auto lines = root.find("lines")) {
    look.lines.emplace();
    for (const ConfigNode& item : lines->items()) look.lines->push_back(item.text());
  }
  if (const auto drawn = root.find("drawn"))
    for (const ConfigNode& item : drawn->items()) look.drawn.push_back(read_drawn_line(item));
  if (const auto finish = root.find("finish")) look.finish = finish->choice(finish_names(scene));
  if (const auto cut = root.find("cut")) look.cut = read_cut_plane(*cut);
  LIMN_TRY_STATUS(config.status());
  return look;
}

}  // namespace limn::scene
