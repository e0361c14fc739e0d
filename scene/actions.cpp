#include "scene/actions.h"

#include <algorithm>
#include <type_traits>

#include "core/names.h"
#include "scene/command_text.h"
#include "scene/drawn_lines.h"
#include "scene/meshes/mesh.h"

namespace limn::scene {

struct Change {
  const Scene& scene;
  const PosedScene& posed;      // what was shown last
  const std::string_view name;  // the action's name, for errors
  const std::size_t slot_index;
  ShowState show_state;  // before the action, then after it

  const Slot& slot() const { return scene.slots[slot_index]; }
  ShowState::Slot& chosen() { return show_state.slots[slot_index]; }
};

namespace {

std::vector<std::string> variant_names(const Slot& slot) {
  std::vector<std::string> names;
  for (const Variant& variant : slot.variants) names.push_back(variant.name);
  return names;
}

// The element `steps` after `name`, cyclically.
const std::string& stepped(const std::vector<std::string>& names, const std::string& name, int steps) {
  const auto found = std::find(names.begin(), names.end(), name);
  const int count = static_cast<int>(names.size());
  // An unknown name counts as before the first: one step forward gives the first, one step back the last.
  const int at = found == names.end() ? (steps > 0 ? -1 : 0) : static_cast<int>(found - names.begin());
  return names[static_cast<std::size_t>(((at + steps) % count + count) % count)];
}

// ---- The actions. Each takes the value after reading; on an error the change is discarded. ----

template <int k_steps>
Status step_variant(Change* change, std::monostate) {
  std::string& variant = change->chosen().variant;
  variant = stepped(variant_names(change->slot()), variant, k_steps);
  return {};
}

Status choose_variant(Change* change, const std::string& variant) {
  const std::vector<std::string> names = variant_names(change->slot());
  if (std::find(names.begin(), names.end(), variant) == names.end())
    return error("{}: expected a variant of slot '{}' ({}), found '{}'.", change->name, change->slot().name,
                 listed(names), variant);
  change->chosen().variant = variant;
  return {};
}

Status nudge(Change* change, const Eigen::Vector3d& mm) {
  ShowState::Slot& slot = change->chosen();
  slot.nudge += 1e-3 * mm;
  if (slot.pin)
    slot.pin->prototype_from_part =
        slot.pin->prototype_from_part * Pose(Eigen::Quaterniond::Identity(), 1e-3 * mm);
  return {};
}

Status place(Change* change, const Pose& prototype_from_part) {
  change->chosen().nudge.setZero();
  change->chosen().pin = Pin{prototype_from_part, std::nullopt};
  return {};
}

Status release(Change* change, std::monostate) {
  change->chosen().nudge.setZero();
  change->chosen().pin.reset();
  return {};
}

Status pair(Change* change, const std::optional<MarkerName>& marker) {
  if (!marker)
    return error(
        "{}: expected a marker that carries nothing and lies still, found none. Lay one down for a second.",
        change->name);
  if (const Status can = check_carrier(change->scene, change->show_state, *marker, change->slot_index); !can)
    return error("{}: {}", change->name, can.message());
  change->chosen().pin.reset();
  if (*marker == change->slot().marker)
    change->chosen().marker.reset();
  else
    change->chosen().marker = *marker;
  return {};
}

Status unpair(Change* change, std::monostate) { return pair(change, change->slot().marker); }

// The show state does not change: the session stores the unit beside the part's file.
Status set_unit(Change* change, const PartUnit& wanted) {
  std::vector<std::string> dropped;
  for (const Variant& variant : change->slot().variants)
    if (variant.auto_imported) dropped.push_back(variant.name);
  if (std::find(dropped.begin(), dropped.end(), wanted.part) == dropped.end())
    return error("{}: expected a part that was dropped into slot '{}' ({}) and its unit, found '{}'.",
                 change->name, change->slot().name, listed(dropped), wanted.words);
  return {};
}

Status set_material(Change* change, const MaterialOverride& material) {
  change->chosen().material = material;
  return {};
}

Status set_window(Change* change, const std::optional<GreyWindow>& window) {
  const std::vector<Variant>& variants = change->slot().variants;
  if (std::none_of(variants.begin(), variants.end(), [](const Variant& v) { return v.volume != nullptr; }))
    return error("{}: expected a slot with a volume (NIfTI, DICOM), found slot '{}' with meshes only.",
                 change->name, change->slot().name);
  change->chosen().window = window;
  return {};
}

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

std::vector<std::string> line_names(const Change& change) {
  std::vector<std::string> names;
  for (const Line& line : change.scene.lines) names.push_back(line.name);
  for (const DrawnLine& line : change.show_state.drawn) names.push_back(line.name);
  return names;
}

// Without a name, all lines go on or off together.
Status set_line(Change* change, const LineSwitch& choice) {
  std::vector<std::string>& shown = change->show_state.lines;
  const std::vector<std::string> names = line_names(*change);
  const bool is_all = choice.line.empty();
  if (!is_all && std::find(names.begin(), names.end(), choice.line) == names.end())
    return error("{}: expected one of the lines ({}), or no name for all, found '{}'.", change->name,
                 listed(names), choice.line);
  const bool is_on =
      is_all ? !shown.empty() : std::find(shown.begin(), shown.end(), choice.line) != shown.end();
  const bool wanted = choice.wanted == Switch::toggle ? !is_on : choice.wanted == Switch::on;
  if (is_all) {
    shown = wanted ? names : std::vector<std::string>();
  } else {
    std::erase(shown, choice.line);
    if (wanted) shown.push_back(choice.line);
  }
  return {};
}

// The actions on drawn lines (drawn_lines.h).
Status named(const Change& change, const Status& done) {
  return done ? Status() : error("{}: {}", change.name, done.message());
}

Status draw(Change* change, const LineStroke& value) {
  return named(*change, draw_line(change->scene, value.line, value.stroke, &change->show_state));
}

Status erase(Change* change, const LineName& value) {
  return named(*change, erase_line(value.line, &change->show_state));
}

Status smooth(Change* change, const LineName& value) {
  return named(*change, smooth_line(change->scene, value.line, &change->show_state));
}

Status pull(Change* change, const LineStroke& value) {
  return named(*change, move_line(change->scene, value.line, value.stroke, &change->show_state));
}

Status rename(Change* change, const LineName& value) {
  return named(*change, rename_line(change->scene, value.line, value.new_name, &change->show_state));
}

std::string unused_look_name(const ShowState& show_state) {
  for (int i = 1;; ++i)
    if (std::string name = fmt::format("look-{:02}", i); !find_look(show_state, name)) return name;
}

// Edits that came after the last frame was drawn are part of the look, too.
void take_edits_since(const Scene& scene, const ShowState& show_state, Look* look) {
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    const ShowState::Slot& slot = show_state.slots[i];
    auto part = std::find_if(look->parts.begin(), look->parts.end(),
                             [&](const Look::Part& p) { return p.slot == scene.slots[i].name; });
    if (part == look->parts.end()) {
      if (!slot.pin) continue;
      part =
          look->parts.insert(part, {.slot = scene.slots[i].name, .variant = {}, .prototype_from_part = {}});
    }
    part->variant = slot.variant;
    part->material = slot.material;
    part->window = slot.window;
    if (slot.pin) part->prototype_from_part = slot.pin->prototype_from_part;
  }
  look->light = show_state.light;
  look->finish = show_state.finish;
  if (!show_state.section.is_on) look->cut.reset();
  if (show_state.section.is_held && show_state.section.plane) look->cut = show_state.section.plane;
  look->lines = show_state.lines;
  look->drawn = shown_drawn_lines(show_state);
}

Status save_look(Change* change, const std::string& name) {
  ShowState& show_state = change->show_state;
  const PosedScene& posed = change->posed;
  Look look;
  look.name = name.empty() ? unused_look_name(show_state) : name;
  if (!is_look_name(look.name))
    return error("{}: expected a name of letters, digits, spaces, '-', '_' and '.', found '{}'.",
                 change->name, look.name);
  const Pose prototype_from_world =
      posed.world_from_prototype ? posed.world_from_prototype->inverse() : Pose{};
  for (const PosedPart& part : posed.parts)
    look.parts.push_back(
        {part.slot, part.variant, prototype_from_world * part.world_from_part, part.material, part.window});
  look.light = posed.light;
  look.finish = posed.finish;
  if (posed.cut) look.cut = transformed(prototype_from_world, *posed.cut);
  look.lines = posed.lines;
  for (const DrawnLine& line : posed.drawn) {
    if (find_named(change->scene.lines, line.name)) continue;  // an outline
    look.drawn.push_back(line);
    look.lines->push_back(line.name);
  }
  if (!show_state.frozen) take_edits_since(change->scene, show_state, &look);
  if (!look.light) look.light = change->scene.light;
  remember_look(look.name, &show_state);
  std::erase_if(show_state.looks, [&](const Look& known) { return known.name == look.name; });
  show_state.looks.push_back(std::move(look));
  return {};
}

Error no_such_look(const Change& change, const std::string& name) {
  return error("{}: expected one of {}, found '{}'.", change.name, listed(look_names(change.show_state)),
               name);
}

Status restore_look(Change* change, const std::string& name) {
  const Look* found = find_look(change->show_state, name);
  if (!found) return no_such_look(*change, name);
  const Look look = *found;
  change->show_state = with_look(change->scene, std::move(change->show_state), look);
  return {};
}

template <int k_steps>
Status step_look(Change* change, std::monostate) {
  const std::vector<std::string> names = look_names(change->show_state);
  if (names.empty()) return error("{}: expected a saved look, found none. Save one.", change->name);
  return restore_look(change, stepped(names, change->show_state.look, k_steps));
}

Status flip(Change* change, const std::string& name) {
  const ShowState& show_state = change->show_state;
  if (name.empty() && show_state.other_look.empty())
    return error("{}: expected two looks shown before, found {}. Save or restore another look first.",
                 change->name, show_state.look.empty() ? "none" : "one");
  return restore_look(change, std::string(name.empty() ? show_state.other_look : name));
}

Status delete_look(Change* change, const std::string& name) {
  ShowState& show_state = change->show_state;
  const Look* found = find_look(show_state, name);
  if (!found) return no_such_look(*change, name);
  show_state.deleted_look = *found;
  show_state.looks.erase(show_state.looks.begin() + (found - show_state.looks.data()));
  if (show_state.look == name) show_state.look.clear();
  if (show_state.other_look == name) {
    show_state.other_look.clear();
    show_state.split = false;
  }
  return {};
}

Status undelete_look(Change* change, std::monostate) {
  ShowState& show_state = change->show_state;
  if (!show_state.deleted_look) return error("{}: expected a deleted look, found none.", change->name);
  if (find_look(show_state, show_state.deleted_look->name))
    return error("{}: expected no other look of that name, found '{}'. Delete it first.", change->name,
                 show_state.deleted_look->name);
  show_state.looks.push_back(std::move(*show_state.deleted_look));
  show_state.deleted_look.reset();
  return {};
}

// The show state does not change: the session measures its devices.
Status repair(Change* change, std::monostate) {
  if (!change->show_state.blackout) return {};
  return error("{}: expected light, found blackout. End the blackout first.", change->name);
}

bool needs_deviation(DeviationRequest::What what) {
  using enum DeviationRequest::What;
  return what == on || what == hold || what == report;
}

// The session measures; it is asked by the request itself.
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

// Sets a flag of the show state.
template <bool ShowState::*k_flag>
Status set_flag(Change* change, Switch wanted) {
  bool& flag = change->show_state.*k_flag;
  flag = wanted == Switch::toggle ? !flag : wanted == Switch::on;
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

// ---- The table. ----

template <auto k_read>
using ValueOf = std::decay_t<decltype(*k_read(std::declval<const Edit&>()))>;

template <auto k_read>
Result<ActionValue> read_with(const Edit& edit) {
  LIMN_TRY(ValueOf<k_read> value, k_read(edit));
  return ActionValue(std::move(value));
}

template <auto k_read, auto k_apply>
Status apply_with(Change* change, const ActionValue& value) {
  return k_apply(change, std::get<ValueOf<k_read>>(value));
}

// The functions of an action: k_read reads its value, k_apply takes exactly that type.
template <auto k_read, auto k_apply>
constexpr Action::Functions k_by = {&read_with<k_read>, &apply_with<k_read, k_apply>};

using enum ArgumentKind;
using enum Role;

constexpr std::array<Action, k_action_count> k_actions = {{
    {.id = ActionId::next_variant,
     .name = "next_variant",
     .role = work,
     .of_slot = true,
     .what = "shows the slot's next variant",
     .opposite = ActionId::previous_variant,
     .keys = {Key::right, Key::page_down, Key{'N'}},
     .functions = k_by<read_nothing, step_variant<1>>},
    {.id = ActionId::previous_variant,
     .name = "previous_variant",
     .role = work,
     .of_slot = true,
     .what = "shows the slot's previous variant",
     .opposite = ActionId::next_variant,
     .keys = {Key::left, Key::page_up, Key{'P'}},
     .functions = k_by<read_nothing, step_variant<-1>>},
    {.id = ActionId::choose_variant,
     .name = "choose_variant",
     .role = work,
     .of_slot = true,
     .argument_kind = text,
     .value = "a variant",
     .what = "shows the variant of this name",
     .functions = k_by<read_text, choose_variant>},
    {.id = ActionId::nudge,
     .name = "nudge",
     .role = work,
     .of_slot = true,
     .argument_kind = millimetres,
     .value = "three numbers, mm",
     .what = "moves the part along its own axes",
     .functions = k_by<read_millimetres, nudge>},
    {.id = ActionId::place,
     .name = "place",
     .role = work,
     .of_slot = true,
     .argument_kind = ArgumentKind::pose,
     .value = "x, y, z in mm; quaternion w, x, y, z",
     .what = "puts the part at this pose on the prototype until its marker is moved",
     .functions = k_by<read_place, place>},
    {.id = ActionId::release,
     .name = "release",
     .role = work,
     .of_slot = true,
     .what = "lets the part follow its marker again, without nudges",
     .keys = {Key{'R'}},
     .functions = k_by<read_nothing, release>},
    {.id = ActionId::pair,
     .name = "pair",
     .role = operate,
     .of_slot = true,
     .argument_kind = maybe_text,
     .value = "a marker; empty: the one that glows",
     .what = "lets this marker carry the part from now on",
     .keys = {Key{'A'}},
     .functions = k_by<read_marker, pair>},
    {.id = ActionId::unpair,
     .name = "unpair",
     .role = operate,
     .of_slot = true,
     .what = "lets the scene's own marker carry the part again",
     .functions = k_by<read_nothing, unpair>},
    {.id = ActionId::units,
     .name = "units",
     .role = operate,
     .of_slot = true,
     .argument_kind = text,
     .value = "a variant and m, cm, mm, in or ft",
     .what = "sets the unit of a part whose file was put into the slot's folder",
     .functions = k_by<read_part_unit, set_unit>},
    {.id = ActionId::material,
     .name = "material",
     .role = work,
     .of_slot = true,
     .argument_kind = maybe_text,
     .value = "a colour, metalness, roughness, - for the file's: #c02818 0 0.4",
     .what = "sets the material of all of the part's variants; empty: the file's materials",
     .functions = k_by<read_material, set_material>},
    {.id = ActionId::window,
     .name = "window",
     .role = work,
     .of_slot = true,
     .argument_kind = maybe_text,
     .value = "a width and a level: 400 40",
     .what = "sets which values of the slot's volumes are black and white; empty: as their files say",
     .functions = k_by<read_window, set_window>},
    {.id = ActionId::finish,
     .name = "finish",
     .role = work,
     .argument_kind = maybe_text,
     .value = "a finish of the scene",
     .what = "paints the whole prototype in light; empty: not",
     .functions = k_by<read_text, set_finish>},
    {.id = ActionId::section,
     .name = "section",
     .role = work,
     .argument_kind = maybe_text,
     .value = "on, off, toggle, hold, release, flip or cover; empty: toggle",
     .what = "cuts parts open at the plane of the section's marker, or holds the plane",
     .keys = {Key{'C'}},
     .functions = k_by<read_section_change, set_section>},
    {.id = ActionId::line,
     .name = "line",
     .role = work,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .of = "a line; left out: all",
     .what = "shows or hides a line of light on the prototype",
     .keys = {Key{'I'}},
     .functions = k_by<read_line_switch, set_line>},
    {.id = ActionId::draw_line,
     .name = "draw_line",
     .role = work,
     .argument_kind = text,
     .value = "points and their x y z in mm, or rays and x y z of an eye and directions, on the prototype",
     .of = "a drawn line; left out: a new one",
     .what = "draws a line of light on",
     .functions = k_by<read_line_stroke, draw>},
    {.id = ActionId::erase_line,
     .name = "erase_line",
     .role = work,
     .of = "a drawn line; left out: the last one",
     .what = "removes a drawn line",
     .functions = k_by<read_line_name, erase>},
    {.id = ActionId::smooth_line,
     .name = "smooth_line",
     .role = work,
     .of = "a drawn line; left out: the last one",
     .what = "makes a drawn line smoother; its ends stay",
     .functions = k_by<read_line_name, smooth>},
    {.id = ActionId::move_line,
     .name = "move_line",
     .role = work,
     .argument_kind = text,
     .value = "the first place and the last, as for draw_line",
     .of = "a drawn line; left out: the last one",
     .what = "moves the place of a drawn line that is nearest to the first place to the last",
     .functions = k_by<read_line_stroke, pull>},
    {.id = ActionId::rename_line,
     .name = "rename_line",
     .role = work,
     .argument_kind = text,
     .value = "its new name",
     .of = "a drawn line; left out: the last one",
     .what = "gives a drawn line another name",
     .functions = k_by<read_line_name, rename>},
    {.id = ActionId::save_look,
     .name = "save_look",
     .role = work,
     .argument_kind = maybe_text,
     .value = "a name; empty: look-01 and so on",
     .what = "saves variants, poses, materials, windows, finish, lines, light and cut, as JSON and PNG",
     .keys = {Key{'S'}},
     .functions = k_by<read_text, save_look>},
    {.id = ActionId::restore_look,
     .name = "restore_look",
     .role = work,
     .argument_kind = text,
     .value = "a look",
     .what = "shows a look; each part stays until its marker is moved",
     .functions = k_by<read_text, restore_look>},
    {.id = ActionId::next_look,
     .name = "next_look",
     .role = work,
     .what = "shows the look after the one last shown",
     .opposite = ActionId::previous_look,
     .keys = {Key{'L'}},
     .functions = k_by<read_nothing, step_look<1>>},
    {.id = ActionId::previous_look,
     .name = "previous_look",
     .role = work,
     .what = "shows the look before the one last shown",
     .opposite = ActionId::next_look,
     .keys = {Key{'K'}},
     .functions = k_by<read_nothing, step_look<-1>>},
    {.id = ActionId::flip,
     .name = "flip",
     .role = work,
     .argument_kind = maybe_text,
     .value = "a look; empty: the one shown before",
     .what = "switches to the other of two looks",
     .keys = {Key{'V'}},
     .functions = k_by<read_text, flip>},
    {.id = ActionId::split,
     .name = "split",
     .role = work,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .what = "shows the previous look on the left of a line, the present one on the right",
     .keys = {Key{'X'}},
     .functions = k_by<read_switch, set_split>},
    {.id = ActionId::split_at,
     .name = "split_at",
     .role = work,
     .argument_kind = number,
     .value = "mm to the right of the prototype's middle",
     .what = "moves the line of split",
     .functions = k_by<read_millimetre, move_split>},
    {.id = ActionId::delete_look,
     .name = "delete_look",
     .role = work,
     .argument_kind = text,
     .value = "a look",
     .what = "deletes a look",
     .functions = k_by<read_text, delete_look>},
    {.id = ActionId::undelete_look,
     .name = "undelete_look",
     .role = work,
     .what = "brings back the last deleted look",
     .functions = k_by<read_nothing, undelete_look>},
    {.id = ActionId::repair,
     .name = "repair",
     .role = operate,
     .what =
         "measures a moved device with patterns on the prototype (about 15 s) and corrects the session's rig",
     .functions = k_by<read_nothing, repair>},
    {.id = ActionId::deviation,
     .name = "deviation",
     .role = work,
     .argument_kind = maybe_text,
     .value =
         "scan, on, off, toggle, hold on, hold off, fit X Y Z X Y Z (mm), fit off, tolerance MM, report; "
         "empty: scan",
     .what = "scans the prototype with patterns (20 s at most) and shows how far it is from its CAD",
     .keys = {Key{'D'}},
     .value_of_keys = "toggle",
     .functions = k_by<read_deviation, set_deviation>},
    {.id = ActionId::light,
     .name = "light",
     .role = work,
     .argument_kind = maybe_text,
     .value = "a lamp's degrees right and up, its strength, soft light above and below: 30 45 0.6 0.3 0.1",
     .what = "sets the light that parts are shaded by, as seen from camera 0; empty: the scene's own",
     .functions = k_by<read_light, set_light>},
    {.id = ActionId::blackout,
     .name = "blackout",
     .role = work,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .what = "switches all projected light off: the bare prototype",
     .keys = {Key{'B'}, Key{'.'}},
     .functions = k_by<read_switch, set_flag<&ShowState::blackout>>},
    {.id = ActionId::freeze,
     .name = "freeze",
     .role = work,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .what = "freezes what is shown",
     .keys = {Key{'F'}},
     .functions = k_by<read_switch, set_flag<&ShowState::frozen>>},
    {.id = ActionId::grid,
     .name = "grid",
     .role = work,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .what = "draws lines on the prototype, every 10 mm",
     .keys = {Key{'G'}},
     .functions = k_by<read_switch, set_flag<&ShowState::grid>>},
    {.id = ActionId::marker_states,
     .name = "marker_states",
     .role = operate,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .what = "draws rings around markers: green is measured, amber is extrapolated",
     .keys = {Key{'M'}},
     .functions = k_by<read_switch, set_flag<&ShowState::marker_states>>},
    {.id = ActionId::screen,
     .name = "screen",
     .role = operate,
     .argument_kind = maybe_text,
     .value = "rest, full, camera, view, stereo, off or next",
     .of = "a screen; left out: all",
     .what = "sets what a screen shows, or all screens",
     .keys = {Key{'O'}},
     .value_of_keys = "next",
     .functions = k_by<read_screen, set_screen>},
    {.id = ActionId::viewer,
     .name = "viewer",
     .role = work,
     .argument_kind = maybe_text,
     .value = "a guest's name; empty: the scene's own viewer",
     .what = "draws view parts for this guest's tablet while its camera sees markers",
     .functions = k_by<read_text, set_viewer>},
}};

constexpr bool has_every_row() {
  for (std::size_t i = 0; i < k_action_count; ++i)
    if (static_cast<std::size_t>(k_actions[i].id) != i || k_actions[i].name.empty()) return false;
  return true;
}
static_assert(has_every_row(), "k_actions has a row for every ActionId, in their order");

}  // namespace

const std::string& name_of(Role role) {
  static const std::array<std::string, 3> names = {"look", "work", "operate"};
  return names[static_cast<std::size_t>(role)];
}

std::span<const Action, k_action_count> actions() { return k_actions; }

const Action& action_of(ActionId id) {
  LIMN_CHECK(id < ActionId::count);
  return k_actions[static_cast<std::size_t>(id)];
}

const Action* find_action(std::string_view name) { return find_named(k_actions, name); }

std::string action_names() {
  std::vector<std::string> names;
  for (const Action& action : k_actions) names.emplace_back(action.name);
  return listed(names);
}

Edit make_edit(ActionId action, std::string slot, std::string value) {
  return {std::string(action_of(action).name), std::move(slot), std::move(value)};
}

Result<Command> command_of(const Scene& scene, const Edit& edit) {
  const Action* action = find_action(edit.action);
  if (!action) return error("edit: expected an action ({}), found '{}'.", action_names(), edit.action);
  Command command{.action = action->id, .value = {}};
  if (action->of_slot) {
    const Slot* slot = scene.find_slot(edit.slot);
    if (!slot) {
      std::vector<std::string> names;
      for (const Slot& known : scene.slots) names.push_back(known.name);
      return error("{}: expected a slot of the scene ({}), found '{}'.", edit.action, listed(names),
                   edit.slot);
    }
    command.slot = static_cast<std::size_t>(slot - scene.slots.data());
  }
  LIMN_TRY(command.value, action->functions.read(edit));
  return command;
}

Result<ShowState> apply_edit(const Scene& scene,
                             const ShowState& show_state,
                             const PosedScene& posed,
                             const Command& command) {
  const Action& action = action_of(command.action);
  Change change{scene, posed, action.name, command.slot, show_state};
  LIMN_TRY_STATUS(action.functions.apply(&change, command.value));
  return std::move(change.show_state);
}

Result<ShowState> apply_edit(const Scene& scene,
                             const ShowState& show_state,
                             const PosedScene& posed,
                             const Edit& edit) {
  LIMN_TRY(const Command command, command_of(scene, edit));
  return apply_edit(scene, show_state, posed, command);
}

}  // namespace limn::scene
