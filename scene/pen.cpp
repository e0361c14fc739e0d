#include "scene/pen.h"

#include <fmt/format.h>

namespace limn::scene {

Pen read_pen(const ConfigNode& node) {
  constexpr double k_longest_mm = 1000;  // longer than an arm's tool; the tip's error grows with it
  node.only({"marker", "size_mm", "tip_mm"});
  Pen pen;
  pen.size_m = 1e-3 * node.at("size_mm").positive(k_largest_marker_mm);
  if (const auto tip = node.find("tip_mm")) {
    pen.p_tip_marker = 1e-3 * tip->vector3();
    if (pen.p_tip_marker.norm() > 1e-3 * k_longest_mm)
      tip->problem(
          fmt::format("expected a tip within {} mm of the marker, found one farther away.", k_longest_mm));
  }
  return pen;
}

}  // namespace limn::scene
