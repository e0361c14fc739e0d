#include "scene/action_value.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "scene/command_text.h"
#include "scene/volume_part.h"

namespace limn::scene {
namespace {

constexpr double k_most_nudge_mm = 1000, k_most_split_mm = 5000, k_most_place_mm = 5000;
constexpr double k_least_quaternion = 0.5, k_most_quaternion = 2;  // accepted length; it is normalised to 1

}  // namespace

Result<std::monostate> read_nothing(const Edit&) { return std::monostate(); }

Result<std::string> read_text(const Edit& edit) { return edit.value; }

Result<double> read_millimetre(const Edit& edit) {
  std::istringstream text(edit.value);
  double mm = 0;
  std::string rest;
  if (!(text >> mm) || text >> rest || !(std::abs(mm) <= k_most_split_mm))
    return error("{}: expected a number of millimetres, at most {}, found '{}'.", edit.action,
                 k_most_split_mm, edit.value);
  return mm;
}

Result<Eigen::Vector3d> read_millimetres(const Edit& edit) {
  std::istringstream text(edit.value);
  Eigen::Vector3d mm;
  std::string rest;
  if (!(text >> mm.x() >> mm.y() >> mm.z()) || text >> rest || !(mm.cwiseAbs().maxCoeff() <= k_most_nudge_mm))
    return error("{}: expected three numbers of millimetres, at most {}, found '{}'.", edit.action,
                 k_most_nudge_mm, edit.value);
  return mm;
}

Result<Pose> read_place(const Edit& edit) {
  std::istringstream text(edit.value);
  Eigen::Vector3d mm;
  Eigen::Quaterniond turn;
  std::string rest;
  if (!(text >> mm.x() >> mm.y() >> mm.z() >> turn.w() >> turn.x() >> turn.y() >> turn.z()) || text >> rest ||
      !(mm.cwiseAbs().maxCoeff() <= k_most_place_mm))
    return error("{}: expected x, y, z in millimetres, at most {}, and a quaternion w, x, y, z, found '{}'.",
                 edit.action, k_most_place_mm, edit.value);
  if (!(turn.norm() >= k_least_quaternion && turn.norm() <= k_most_quaternion))
    return error("{}: expected a quaternion of length 1, found length {:.3g}.", edit.action, turn.norm());
  return Pose(turn.normalized(), 1e-3 * mm);
}

Result<Switch> read_switch(const Edit& edit) {
  if (edit.value.empty() || edit.value == "toggle") return Switch::toggle;
  if (edit.value == "on") return Switch::on;
  if (edit.value == "off") return Switch::off;
  return error("{}: expected on, off or toggle, found '{}'.", edit.action, edit.value);
}

Result<SectionChange> read_section_change(const Edit& edit) {
  if (edit.value.empty()) return SectionChange::toggle;
  if (const auto change = k_section_changes.find(edit.value)) return *change;
  return error("{}: expected one of {}, found '{}'.", edit.action, listed(k_section_changes.all()),
               edit.value);
}

Result<ScreenChoice> read_screen(const Edit& edit) {
  if (edit.value.empty() || edit.value == "next") return ScreenChoice{edit.slot, std::nullopt};
  const std::vector<std::string>& names = screen_names();
  const auto found = std::find(names.begin(), names.end(), edit.value);
  if (found == names.end())
    return error("{}: expected one of {}, found '{}'.", edit.action, listed(names), edit.value);
  return ScreenChoice{edit.slot, static_cast<Screen>(found - names.begin())};
}

// A part's name may contain spaces: the unit is the last word.
Result<PartUnit> read_part_unit(const Edit& edit) {
  const auto blank = edit.value.rfind(' ');
  const std::string word = blank == std::string::npos ? "" : edit.value.substr(blank + 1);
  const auto unit = k_length_units.find(word);
  if (!unit)
    return error("{}: expected m, cm, mm, in or ft after the part's name, found '{}'.", edit.action, word);
  return PartUnit{edit.value, edit.value.substr(0, blank), *unit};
}

Result<std::optional<MarkerName>> read_marker(const Edit& edit) {
  if (edit.value.empty()) return std::optional<MarkerName>();
  auto marker = MarkerName::parse(edit.value);
  if (!marker) return error("{}: {}", edit.action, marker.message());
  return std::optional(std::move(*marker));
}

Result<MaterialOverride> read_material(const Edit& edit) { return parse_material_override(edit.value); }

Result<std::optional<GreyWindow>> read_window(const Edit& edit) { return parse_grey_window(edit.value); }

Result<std::optional<LightNumbers>> read_light(const Edit& edit) {
  if (edit.value.empty()) return std::optional<LightNumbers>();
  LIMN_TRY(const LightNumbers numbers, light_numbers_of(edit.value));
  return std::optional(numbers);
}

}  // namespace limn::scene
