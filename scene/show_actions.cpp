// The actions on what is shown, and on where.
#include <algorithm>

#include "core/names.h"
#include "scene/action_functions.h"
#include "scene/command_text.h"

namespace limn::scene::apply {
namespace {

bool needs_deviation(DeviationRequest::What what) {
  using enum DeviationRequest::What;
  return what == on || what == hold || what == report;
}

}  // namespace

Status set_finish(Change* change, const std::string& name) {
  const std::vector<std::string> names = finish_names(change->scene);
  if (!name.empty() && std::find(names.begin(), names.end(), name) == names.end())
    return error("{}: expected one of the scene's finishes ({}), or none for the bare prototype, found '{}'.",
                 change->name, listed(names), name);
  change->show_state.finish = name;
  return {};
}

Status set_section(Change* change, SectionChange wanted) {
  if (!change->scene.section)
    return error(
        "{}: expected a scene with a section, found one without. Add `section` to its scene.json "
        "(config/README.md).",
        change->name);
  change->show_state.section = changed(change->show_state.section, wanted);
  return {};
}

Status repair(Change* change, std::monostate) {
  if (!change->show_state.blackout) return {};
  return error("{}: expected light, found blackout. End the blackout first.", change->name);
}

Status set_deviation(Change* change, const DeviationRequest& request) {
  using enum DeviationRequest::What;
  const auto& prototype = change->scene.prototype;
  DeviationChoice& choice = change->show_state.deviation;
  if (!prototype || prototype->mesh.triangles.empty())
    return error(
        "{}: expected a prototype with a CAD mesh to compare with, found none. Give scene.json a "
        "prototype.",
        change->name);
  const bool scans = request.what == scan || (request.what == toggle && !choice.layer);
  if (scans && change->show_state.blackout)
    return error("{}: expected light, found blackout. End the blackout first.", change->name);
  if (needs_deviation(request.what) && !choice.layer)
    return error("{}: expected a result, found none. Scan the prototype first (deviation without a value).",
                 change->name);
  switch (request.what) {
    case scan:
      break;
    case report:
      break;
    case on:
      choice.is_shown = true;
      break;
    case off:
      choice.is_shown = false;
      break;
    case toggle:
      choice.is_shown = !choice.is_shown && choice.layer;
      break;
    case hold:
      choice.is_held = true;
      break;
    case release:
      choice.is_held = false;
      break;
    case fit_box:
      choice.fit_box = request.box;
      break;
    case fit_all:
      choice.fit_box.reset();
      break;
    case tolerance:
      choice.tolerance_m = request.tolerance_m;
      break;
  }
  return {};
}

Status set_light(Change* change, const std::optional<LightNumbers>& numbers) {
  ShowState& show_state = change->show_state;
  const std::optional<RoomLight>& own = change->scene.light;
  if (!numbers) {
    show_state.light.reset();
    return {};
  }
  RoomLight light =
      parse_room_light(*numbers, own ? own->d_up_world : show_state.d_up_world, show_state.d_front_world);
  if (const auto& before = show_state.light ? show_state.light : own)
    light.image_strength = before->image_strength;  // the numbers say nothing about the picture of the room
  show_state.light = std::move(light);
  return {};
}

Status set_split(Change* change, Switch wanted) {
  LIMN_TRY_STATUS(set_flag<&ShowState::split>(change, wanted));
  if (change->show_state.split && change->show_state.other_look.empty())
    return error(
        "{}: expected a look shown before the present one, found none. Save or restore two looks first.",
        change->name);
  return {};
}

Status move_split(Change* change, double mm) {
  change->show_state.split_mm = mm;
  return {};
}

Status set_screen(Change* change, const ScreenChoice& choice) {
  ShowState& show_state = change->show_state;
  Output* output = find_named(show_state.screens, choice.screen);
  const bool is_all = choice.screen.empty();
  if (!is_all && output == nullptr) {
    std::vector<std::string> outputs;
    for (const Output& known : show_state.screens) outputs.push_back(known.name);
    return error("{}: expected a screen of the devices file ({}), or no name for all screens, found '{}'.",
                 change->name, listed(outputs), choice.screen);
  }
  const auto before = static_cast<std::size_t>(is_all ? show_state.screen : output->shows);
  const auto shows = choice.shows.value_or(static_cast<Screen>((before + 1) % screen_names().size()));
  if (!is_all) {
    output->shows = shows;
    return {};
  }
  show_state.screen = shows;
  for (Output& each : show_state.screens) each.shows = shows;
  return {};
}

Status set_viewer(Change* change, const std::string& guest) {
  change->show_state.viewer = guest;
  return {};
}

}  // namespace limn::scene::apply
