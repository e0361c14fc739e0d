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

Result<LineSwitch> read_line_switch(const Edit& edit) {
  LIMN_TRY(const Switch wanted, read_switch(edit));
  return LineSwitch{edit.slot, wanted};
}

Result<LineStroke> read_line_stroke(const Edit& edit) {
  const auto wrong = [&] {
    return error(
        "{}: expected 'points' and x y z of each in mm, or 'rays', x y z of the eye and a direction for "
        "each, at most "
        "{}, found '{}'.",
        edit.action, k_most_stroke_points, edit.value.substr(0, 60));
  };
  std::istringstream text(edit.value);
  std::string kind;
  text >> kind;
  std::vector<Eigen::Vector3d> numbers;
  for (Eigen::Vector3d v; text >> v.x();) {
    if (!(text >> v.y() >> v.z()) || !v.allFinite() || v.cwiseAbs().maxCoeff() > k_most_place_mm * 10 ||
        numbers.size() > k_most_stroke_points)
      return wrong();
    numbers.push_back(v);
  }
  LineStroke out{edit.slot, {}};
  const bool is_rays = kind == "rays";
  if ((!is_rays && kind != "points") || !text.eof() || numbers.size() < (is_rays ? 2U : 1U)) return wrong();
  if (is_rays) {
    out.stroke.p_camera = 1e-3 * numbers.front();
    numbers.erase(numbers.begin());
  }
  for (const Eigen::Vector3d& v : numbers) {
    if (is_rays && !(v.norm() > 1e-6)) return wrong();
    out.stroke.points.push_back(is_rays ? v.normalized() : Eigen::Vector3d(1e-3 * v));
  }
  return out;
}

Result<LineName> read_line_name(const Edit& edit) { return LineName{edit.slot, edit.value}; }

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

Result<DeviationRequest> read_deviation(const Edit& edit) {
  return parse_deviation_request(edit.action, edit.value);
}
Result<std::optional<GreyWindow>> read_window(const Edit& edit) { return parse_grey_window(edit.value); }

Result<std::optional<LightNumbers>> read_light(const Edit& edit) {
  if (edit.value.empty()) return std::optional<LightNumbers>();
  LIMN_TRY(const LightNumbers numbers, light_numbers_of(edit.value));
  return std::optional(numbers);
}

}  // namespace limn::scene
