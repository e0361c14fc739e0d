#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/result.h"
#include "scene/action_value.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "scene/show_state.h"

namespace limn::scene {

/// Everything that people and programs can do in a session. Each has its row in actions.cpp, in this order;
/// one without a row does not compile.
enum class ActionId {
  next_variant,
  previous_variant,
  choose_variant,
  nudge,
  place,
  release,
  pair,
  unpair,
  units,
  material,
  save_look,
  restore_look,
  next_look,
  previous_look,
  flip,
  split,
  split_at,
  delete_look,
  undelete_look,
  repair,
  light,
  blackout,
  freeze,
  grid,
  marker_states,
  screen,
  viewer,
  count  ///< of the actions; none itself
};
constexpr auto k_action_count = static_cast<std::size_t>(ActionId::count);

/// What somebody of the remote may do; each may do what those before it may (docs/remote.md).
enum class Role { look, work, operate };
const std::string& name_of(Role role);  ///< "look", "work", "operate"

/// A key of a keyboard, a presentation clicker or a pedal, by GLFW's codes: letters and marks are themselves,
/// capital ('N').
enum class Key : int { none = 0, tab = 258, right = 262, left = 263, page_up = 266, page_down = 267 };

/// What an action is done to (actions.cpp).
struct Change;

/// A row of the table of actions: all that the rest of Limn knows of an action.
struct Action {
  /// How it is done. `apply` takes what `read` has made of the text.
  struct Functions {
    Result<ActionValue> (*read)(const Edit&);
    Status (*apply)(Change*, const ActionValue&);
  };
  ActionId id;
  std::string_view name;  ///< by which files, messages and OSC call it
  Role role;              ///< the least that may do it
  bool of_slot = false;
  ArgumentKind argument_kind = ArgumentKind::nothing;
  std::string_view value = {};            ///< what Edit::value says, in words; empty: nothing
  std::string_view of = {};               ///< what Edit::slot may name when it is on no slot; empty: nothing
  std::string_view what;                  ///< what it does, a sentence for people
  std::optional<ActionId> opposite = {};  ///< what a control marker does that is turned backwards
  std::array<Key, 3> keys = {};           ///< the operator's, which do it to the chosen slot
  std::string_view value_of_keys = {};    ///< what they give as the value
  Functions functions;
};

/// The table, in the order of ActionId.
std::span<const Action, k_action_count> actions();
const Action& action_of(ActionId id);
/// The action of that name; nullptr: there is none.
const Action* find_action(std::string_view name);
/// "next_variant, previous_variant, …": for errors.
std::string action_names();

/// An action as it is told and recorded.
Edit make_edit(ActionId action, std::string slot = {}, std::string value = {});

/// An edit that was read: its names are known, its value has a type.
struct Command {
  ActionId action;
  std::size_t slot = 0;  ///< of actions on a slot: which of the scene's
  ActionValue value;
};

/// Error: an unknown action or slot, or a value that is not what the action takes.
Result<Command> command_of(const Scene& scene, const Edit& edit);

/// The show state after a command. `posed` is what was shown last: looks are saved from it. Error, and
/// nothing has changed: a variant, look, marker or screen that is not there, or what cannot be done now.
Result<ShowState> apply_edit(const Scene& scene,
                             const ShowState& show_state,
                             const PosedScene& posed,
                             const Command& command);
/// The same from text; errors of command_of(), too.
Result<ShowState> apply_edit(const Scene& scene,
                             const ShowState& show_state,
                             const PosedScene& posed,
                             const Edit& edit);

}  // namespace limn::scene
