// The actions on lines of light.
#include <algorithm>

#include "core/names.h"
#include "scene/action_functions.h"
#include "scene/command_text.h"
#include "scene/drawn_lines.h"

namespace limn::scene::apply {
namespace {

std::vector<std::string> line_names(const Change& change) {
  std::vector<std::string> names;
  for (const Line& line : change.scene.lines) names.push_back(line.name);
  for (const DrawnLine& line : change.show_state.drawn) names.push_back(line.name);
  return names;
}

Status named(const Change& change, const Status& done) {
  return done ? Status() : error("{}: {}", change.name, done.message());
}

}  // namespace

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

}  // namespace limn::scene::apply
