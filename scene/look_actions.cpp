// The actions on looks.
#include <algorithm>

#include "core/names.h"
#include "scene/action_functions.h"
#include "scene/command_text.h"
#include "scene/drawn_lines.h"

namespace limn::scene::apply {
namespace {

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

Error no_such_look(const Change& change, const std::string& name) {
  return error("{}: expected one of {}, found '{}'.", change.name, listed(look_names(change.show_state)),
               name);
}

}  // namespace

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

Status restore_look(Change* change, const std::string& name) {
  const Look* found = find_look(change->show_state, name);
  if (!found) return no_such_look(*change, name);
  const Look look = *found;
  change->show_state = with_look(change->scene, std::move(change->show_state), look);
  return {};
}

namespace {

Status step_look(Change* change, int steps) {
  const std::vector<std::string> names = look_names(change->show_state);
  if (names.empty()) return error("{}: expected a saved look, found none. Save one.", change->name);
  return restore_look(change, stepped(names, change->show_state.look, steps));
}

}  // namespace

Status next_look(Change* change, std::monostate) { return step_look(change, 1); }

Status previous_look(Change* change, std::monostate) { return step_look(change, -1); }

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

}  // namespace limn::scene::apply
