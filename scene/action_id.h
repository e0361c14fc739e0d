#pragma once

#include <cstddef>

namespace limn::scene {

/// Everything that people and programs can do in a session. Each action has a row in the table in
/// actions.cpp, in this order; a missing row is a compiler error.
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
  window,
  finish,
  section,
  line,
  draw_line,
  erase_line,
  smooth_line,
  move_line,
  rename_line,
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
  deviation,
  light,
  blackout,
  freeze,
  grid,
  marker_states,
  screen,
  viewer,
  count  ///< The number of actions; not an action.
};
constexpr auto k_action_count = static_cast<std::size_t>(ActionId::count);

}  // namespace limn::scene
