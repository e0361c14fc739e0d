#include "scene/actions.h"

#include <algorithm>
#include <type_traits>

#include "core/names.h"
#include "scene/action_functions.h"
#include "scene/command_text.h"

namespace limn::scene {
namespace {

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
     .functions = k_by<read_nothing, apply::next_variant>},
    {.id = ActionId::previous_variant,
     .name = "previous_variant",
     .role = work,
     .of_slot = true,
     .what = "shows the slot's previous variant",
     .opposite = ActionId::next_variant,
     .keys = {Key::left, Key::page_up, Key{'P'}},
     .functions = k_by<read_nothing, apply::previous_variant>},
    {.id = ActionId::choose_variant,
     .name = "choose_variant",
     .role = work,
     .of_slot = true,
     .argument_kind = text,
     .value = "a variant",
     .what = "shows the variant of this name",
     .functions = k_by<read_text, apply::choose_variant>},
    {.id = ActionId::nudge,
     .name = "nudge",
     .role = work,
     .of_slot = true,
     .argument_kind = millimetres,
     .value = "three numbers, mm",
     .what = "moves the part along its own axes",
     .functions = k_by<read_millimetres, apply::nudge>},
    {.id = ActionId::place,
     .name = "place",
     .role = work,
     .of_slot = true,
     .argument_kind = ArgumentKind::pose,
     .value = "x, y, z in mm; quaternion w, x, y, z",
     .what = "puts the part at this pose on the prototype until its marker is moved",
     .functions = k_by<read_place, apply::place>},
    {.id = ActionId::release,
     .name = "release",
     .role = work,
     .of_slot = true,
     .what = "lets the part follow its marker again, without nudges",
     .keys = {Key{'R'}},
     .functions = k_by<read_nothing, apply::release>},
    {.id = ActionId::pair,
     .name = "pair",
     .role = operate,
     .of_slot = true,
     .argument_kind = maybe_text,
     .value = "a marker; empty: the one that glows",
     .what = "lets this marker carry the part from now on",
     .keys = {Key{'A'}},
     .functions = k_by<read_marker, apply::pair>},
    {.id = ActionId::unpair,
     .name = "unpair",
     .role = operate,
     .of_slot = true,
     .what = "lets the scene's own marker carry the part again",
     .functions = k_by<read_nothing, apply::unpair>},
    {.id = ActionId::units,
     .name = "units",
     .role = operate,
     .of_slot = true,
     .argument_kind = text,
     .value = "a variant and m, cm, mm, in or ft",
     .what = "sets the unit of a part whose file was put into the slot's folder",
     .functions = k_by<read_part_unit, apply::set_unit>},
    {.id = ActionId::material,
     .name = "material",
     .role = work,
     .of_slot = true,
     .argument_kind = maybe_text,
     .value = "a colour, metalness, roughness, - for the file's: #c02818 0 0.4",
     .what = "sets the material of all of the part's variants; empty: the file's materials",
     .functions = k_by<read_material, apply::set_material>},
    {.id = ActionId::window,
     .name = "window",
     .role = work,
     .of_slot = true,
     .argument_kind = maybe_text,
     .value = "a width and a level: 400 40",
     .what = "sets which values of the slot's volumes are black and white; empty: as their files say",
     .functions = k_by<read_window, apply::set_window>},
    {.id = ActionId::finish,
     .name = "finish",
     .role = work,
     .argument_kind = maybe_text,
     .value = "a finish of the scene",
     .what = "paints the whole prototype in light; empty: not",
     .functions = k_by<read_text, apply::set_finish>},
    {.id = ActionId::section,
     .name = "section",
     .role = work,
     .argument_kind = maybe_text,
     .value = "on, off, toggle, hold, release, flip or cover; empty: toggle",
     .what = "cuts parts open at the plane of the section's marker, or holds the plane",
     .keys = {Key{'C'}},
     .functions = k_by<read_section_change, apply::set_section>},
    {.id = ActionId::line,
     .name = "line",
     .role = work,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .of = "a line; left out: all",
     .what = "shows or hides a line of light on the prototype",
     .keys = {Key{'I'}},
     .functions = k_by<read_line_switch, apply::set_line>},
    {.id = ActionId::draw_line,
     .name = "draw_line",
     .role = work,
     .argument_kind = text,
     .value = "points and their x y z in mm, or rays and x y z of an eye and directions, on the prototype",
     .of = "a drawn line; left out: a new one",
     .what = "draws a line of light on",
     .functions = k_by<read_line_stroke, apply::draw>},
    {.id = ActionId::erase_line,
     .name = "erase_line",
     .role = work,
     .of = "a drawn line; left out: the last one",
     .what = "removes a drawn line",
     .functions = k_by<read_line_name, apply::erase>},
    {.id = ActionId::smooth_line,
     .name = "smooth_line",
     .role = work,
     .of = "a drawn line; left out: the last one",
     .what = "makes a drawn line smoother; its ends stay",
     .functions = k_by<read_line_name, apply::smooth>},
    {.id = ActionId::move_line,
     .name = "move_line",
     .role = work,
     .argument_kind = text,
     .value = "the first place and the last, as for draw_line",
     .of = "a drawn line; left out: the last one",
     .what = "moves the place of a drawn line that is nearest to the first place to the last",
     .functions = k_by<read_line_stroke, apply::pull>},
    {.id = ActionId::rename_line,
     .name = "rename_line",
     .role = work,
     .argument_kind = text,
     .value = "its new name",
     .of = "a drawn line; left out: the last one",
     .what = "gives a drawn line another name",
     .functions = k_by<read_line_name, apply::rename>},
    {.id = ActionId::save_look,
     .name = "save_look",
     .role = work,
     .argument_kind = maybe_text,
     .value = "a name; empty: look-01 and so on",
     .what = "saves variants, poses, materials, windows, finish, lines, light and cut, as JSON and PNG",
     .keys = {Key{'S'}},
     .functions = k_by<read_text, apply::save_look>},
    {.id = ActionId::restore_look,
     .name = "restore_look",
     .role = work,
     .argument_kind = text,
     .value = "a look",
     .what = "shows a look; each part stays until its marker is moved",
     .functions = k_by<read_text, apply::restore_look>},
    {.id = ActionId::next_look,
     .name = "next_look",
     .role = work,
     .what = "shows the look after the one last shown",
     .opposite = ActionId::previous_look,
     .keys = {Key{'L'}},
     .functions = k_by<read_nothing, apply::next_look>},
    {.id = ActionId::previous_look,
     .name = "previous_look",
     .role = work,
     .what = "shows the look before the one last shown",
     .opposite = ActionId::next_look,
     .keys = {Key{'K'}},
     .functions = k_by<read_nothing, apply::previous_look>},
    {.id = ActionId::flip,
     .name = "flip",
     .role = work,
     .argument_kind = maybe_text,
     .value = "a look; empty: the one shown before",
     .what = "switches to the other of two looks",
     .keys = {Key{'V'}},
     .functions = k_by<read_text, apply::flip>},
    {.id = ActionId::split,
     .name = "split",
     .role = work,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .what = "shows the previous look on the left of a line, the present one on the right",
     .keys = {Key{'X'}},
     .functions = k_by<read_switch, apply::set_split>},
    {.id = ActionId::split_at,
     .name = "split_at",
     .role = work,
     .argument_kind = number,
     .value = "mm to the right of the prototype's middle",
     .what = "moves the line of split",
     .functions = k_by<read_millimetre, apply::move_split>},
    {.id = ActionId::delete_look,
     .name = "delete_look",
     .role = work,
     .argument_kind = text,
     .value = "a look",
     .what = "deletes a look",
     .functions = k_by<read_text, apply::delete_look>},
    {.id = ActionId::undelete_look,
     .name = "undelete_look",
     .role = work,
     .what = "brings back the last deleted look",
     .functions = k_by<read_nothing, apply::undelete_look>},
    {.id = ActionId::repair,
     .name = "repair",
     .role = operate,
     .what =
         "measures a moved device with patterns on the prototype (about 15 s) and corrects the session's rig",
     .functions = k_by<read_nothing, apply::repair>},
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
     .functions = k_by<read_deviation, apply::set_deviation>},
    {.id = ActionId::light,
     .name = "light",
     .role = work,
     .argument_kind = maybe_text,
     .value = "a lamp's degrees right and up, its strength, soft light above and below: 30 45 0.6 0.3 0.1",
     .what = "sets the light that parts are shaded by, as seen from camera 0; empty: the scene's own",
     .functions = k_by<read_light, apply::set_light>},
    {.id = ActionId::blackout,
     .name = "blackout",
     .role = work,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .what = "switches all projected light off: the bare prototype",
     .keys = {Key{'B'}, Key{'.'}},
     .functions = k_by<read_switch, apply::set_flag<&ShowState::blackout>>},
    {.id = ActionId::freeze,
     .name = "freeze",
     .role = work,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .what = "freezes what is shown",
     .keys = {Key{'F'}},
     .functions = k_by<read_switch, apply::set_flag<&ShowState::frozen>>},
    {.id = ActionId::grid,
     .name = "grid",
     .role = work,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .what = "draws lines on the prototype, every 10 mm",
     .keys = {Key{'G'}},
     .functions = k_by<read_switch, apply::set_flag<&ShowState::grid>>},
    {.id = ActionId::marker_states,
     .name = "marker_states",
     .role = operate,
     .argument_kind = on_off,
     .value = "on, off or toggle",
     .what = "draws rings around markers: green is measured, amber is extrapolated",
     .keys = {Key{'M'}},
     .functions = k_by<read_switch, apply::set_flag<&ShowState::marker_states>>},
    {.id = ActionId::screen,
     .name = "screen",
     .role = operate,
     .argument_kind = maybe_text,
     .value = "rest, full, camera, view, stereo, off or next",
     .of = "a screen; left out: all",
     .what = "sets what a screen shows, or all screens",
     .keys = {Key{'O'}},
     .value_of_keys = "next",
     .functions = k_by<read_screen, apply::set_screen>},
    {.id = ActionId::viewer,
     .name = "viewer",
     .role = work,
     .argument_kind = maybe_text,
     .value = "a guest's name; empty: the scene's own viewer",
     .what = "draws view parts for this guest's tablet while its camera sees markers",
     .functions = k_by<read_text, apply::set_viewer>},
}};

constexpr bool has_every_row() {
  for (std::size_t i = 0; i < k_action_count; ++i)
    if (static_cast<std::size_t>(k_actions[i].id) != i || k_actions[i].name.empty()) return false;
  return true;
}
static_assert(has_every_row(), "k_actions has a row for every ActionId, in their order");

}  // namespace

const std::string& stepped(const std::vector<std::string>& names, const std::string& name, int steps) {
  const auto found = std::find(names.begin(), names.end(), name);
  const int count = static_cast<int>(names.size());
  const int at = found == names.end() ? (steps > 0 ? -1 : 0) : static_cast<int>(found - names.begin());
  return names[static_cast<std::size_t>(((at + steps) % count + count) % count)];
}

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
