#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/result.h"
#include "scene/action_value.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "scene/show_state.h"

namespace limn::scene {

/// What an action works on.
struct Change {
  const Scene& scene;
  const PosedScene& posed;      ///< what was shown last
  const std::string_view name;  ///< the action's name, for errors
  const std::size_t slot_index;
  ShowState show_state;  ///< before the action, then after it

  const Slot& slot() const { return scene.slots[slot_index]; }
  ShowState::Slot& chosen() { return show_state.slots[slot_index]; }
};

/// The functions of the table of actions (actions.cpp). Each takes an action's value after reading. Error:
/// the action is impossible at present; the change is then discarded.
namespace apply {

// part_actions.cpp
Status next_variant(Change* change, std::monostate);
Status previous_variant(Change* change, std::monostate);
Status choose_variant(Change* change, const std::string& variant);
Status nudge(Change* change, const Eigen::Vector3d& mm);
Status place(Change* change, const Pose& prototype_from_part);
Status release(Change* change, std::monostate);
Status pair(Change* change, const std::optional<MarkerName>& marker);
Status unpair(Change* change, std::monostate);
/// The show state does not change: the session stores the unit beside the part's file.
Status set_unit(Change* change, const PartUnit& wanted);
Status set_material(Change* change, const MaterialOverride& material);
Status set_window(Change* change, const std::optional<GreyWindow>& window);

// look_actions.cpp
Status save_look(Change* change, const std::string& name);
Status restore_look(Change* change, const std::string& name);
Status next_look(Change* change, std::monostate);
Status previous_look(Change* change, std::monostate);
Status flip(Change* change, const std::string& name);
Status delete_look(Change* change, const std::string& name);
Status undelete_look(Change* change, std::monostate);

// line_actions.cpp
/// Without a name, all lines go on or off together.
Status set_line(Change* change, const LineSwitch& choice);
// The actions on drawn lines (drawn_lines.h).
Status draw(Change* change, const LineStroke& value);
Status erase(Change* change, const LineName& value);
Status smooth(Change* change, const LineName& value);
Status pull(Change* change, const LineStroke& value);
Status rename(Change* change, const LineName& value);

// show_actions.cpp
Status set_finish(Change* change, const std::string& name);
Status set_section(Change* change, SectionChange wanted);
/// The show state does not change: the session measures its devices.
Status repair(Change* change, std::monostate);
/// The session measures; it is asked by the request itself.
Status set_deviation(Change* change, const DeviationRequest& request);
Status set_light(Change* change, const std::optional<LightNumbers>& numbers);
Status set_split(Change* change, Switch wanted);
Status move_split(Change* change, double mm);
Status set_screen(Change* change, const ScreenChoice& choice);
Status set_viewer(Change* change, const std::string& guest);

/// Sets a flag of the show state.
template <bool ShowState::*k_flag>
Status set_flag(Change* change, Switch wanted) {
  bool& flag = change->show_state.*k_flag;
  flag = wanted == Switch::toggle ? !flag : wanted == Switch::on;
  return {};
}

}  // namespace apply

/// The name `steps` after `name`, cyclically. An unknown name counts as before the first: one step forward
/// gives the first, one step back the last. `names` is not empty.
const std::string& stepped(const std::vector<std::string>& names, const std::string& name, int steps);

}  // namespace limn::scene
