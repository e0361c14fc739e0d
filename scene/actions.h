#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/result.h"
#include "scene/action_id.h"
#include "scene/action_value.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "scene/show_state.h"

namespace limn::scene {

/// What a guest of the remote may do. Each role includes the roles before it (docs/remote.md).
enum class Role { look, work, operate };
const std::string& name_of(Role role);  ///< "look", "work", "operate"

/// A key of a keyboard, a presentation clicker or a pedal, as a GLFW code. The codes of letters and
/// punctuation are their characters, letters in upper case ('N').
enum class Key : int { none = 0, tab = 258, right = 262, left = 263, page_up = 266, page_down = 267 };

/// What an action works on (action_functions.h).
struct Change;

/// A row of the table of actions: everything that the rest of Limn knows about an action.
struct Action {
  /// How the action is done. `read` parses the text; `apply` takes the result.
  struct Functions {
    Result<ActionValue> (*read)(const Edit&);
    Status (*apply)(Change*, const ActionValue&);
  };
  ActionId id;
  std::string_view name;  ///< The action's name in files, messages and OSC.
  Role role;              ///< The lowest role that may do it.
  bool of_slot = false;
  ArgumentKind argument_kind = ArgumentKind::nothing;
  std::string_view value = {};  ///< Description of Edit::value for people; empty: the action takes no value.
  std::string_view of = {};     ///< Meaning of Edit::slot when the action is not on a slot; empty: not used.
  std::string_view what;        ///< Description of the action for people.
  std::optional<ActionId> opposite = {};  ///< The action of a control marker that is turned backwards.
  std::array<Key, 3> keys = {};           ///< The operator's keys for the action, on the chosen slot.
  std::string_view value_of_keys = {};    ///< The value that these keys send.
  Functions functions;
};

/// The table, in the order of ActionId.
std::span<const Action, k_action_count> actions();
const Action& action_of(ActionId id);
/// The action of that name; null when there is none.
const Action* find_action(std::string_view name);
/// The names "next_variant, previous_variant, …" for error messages.
std::string action_names();

/// An edit with the action's name, as it is sent and recorded.
Edit make_edit(ActionId action, std::string slot = {}, std::string value = {});

/// An edit after reading: its names are resolved, its value has a type.
struct Command {
  ActionId action;
  std::size_t slot = 0;  ///< Index of the slot in the scene, for an action on a slot.
  ActionValue value;
};

/// Reads an edit. Error: an unknown action or slot, or a value that the action does not take.
Result<Command> command_of(const Scene& scene, const Edit& edit);

/// The show state after a command. `posed` is what was shown last: looks have the parts' places from it, and
/// all else from the show state; while that is frozen, all from `posed`. Error: an unknown variant, look,
/// marker or screen, or an action that is impossible at present.
Result<ShowState> apply_edit(const Scene& scene,
                             const ShowState& show_state,
                             const PosedScene& posed,
                             const Command& command);
/// As above, from text; errors of command_of() are possible, too.
Result<ShowState> apply_edit(const Scene& scene,
                             const ShowState& show_state,
                             const PosedScene& posed,
                             const Edit& edit);

}  // namespace limn::scene
