#include "scene/section.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace limn::scene {
namespace {

constexpr double k_largest_card_m = 2;
constexpr double k_largest_hatch_mm = 1000, k_largest_offset_mm = 1e5;
constexpr double k_unit = 1e-6;  // largest error of a unit normal's length

}  // namespace

CutPlane cut_plane(const Pose& a_from_plane) {
  const Eigen::Vector3d normal = a_from_plane.rotation * -Eigen::Vector3d::UnitZ();
  return {normal, normal.dot(a_from_plane.translation)};
}

CutPlane transformed(const Pose& a_from_b, const CutPlane& in_b) {
  const Eigen::Vector3d normal = (a_from_b.rotation * in_b.normal).normalized();
  return {normal, in_b.offset_m + normal.dot(a_from_b.translation)};
}

CutPlane flipped(const CutPlane& plane) { return {-plane.normal, -plane.offset_m}; }

double height_over(const CutPlane& plane, const Eigen::Vector3d& p) {
  return plane.normal.dot(p) - plane.offset_m;
}

bool is_plane(const CutPlane& plane) {
  return plane.normal.allFinite() && std::isfinite(plane.offset_m) &&
         std::abs(plane.normal.norm() - 1) < k_unit;
}

bool Section::cuts(const std::string& slot) const {
  return std::find(slots.begin(), slots.end(), slot) != slots.end();
}

Eigen::Vector3d across_hatch(const Eigen::Vector3d& normal_part, int owner) {
  // An oblique direction, to which few planes that people choose are perpendicular.
  const Eigen::Vector3d d_oblique(0.36, 0.48, 0.8);
  Eigen::Vector3d along = d_oblique - d_oblique.dot(normal_part) * normal_part;
  along = along.norm() > 1e-3 ? Eigen::Vector3d(along.normalized()) : normal_part.unitOrthogonal();
  const double turn = std::numbers::pi / 4 * (1 + 2 * (owner % 2)) + std::numbers::pi / 6 * (owner / 2);
  return std::cos(turn) * along + std::sin(turn) * normal_part.cross(along);
}

Section read_section(const ConfigNode& node) {
  node.only({"marker", "size_mm", "marker_from_plane", "slots", "cuts_prototype", "hatch_mm", "cap_colour",
             "card_mm"});
  Section section;
  section.size_m = 1e-3 * node.at("size_mm").positive(k_largest_marker_mm);
  if (const auto pose = node.find("marker_from_plane")) section.marker_from_plane = pose->pose();
  if (const auto cuts = node.find("cuts_prototype")) section.cuts_prototype = cuts->boolean();
  if (const auto hatch = node.find("hatch_mm")) section.hatch_m = 1e-3 * hatch->positive(k_largest_hatch_mm);
  if (const auto card = node.find("card_mm")) {
    const std::vector<double> size_mm = card->numbers(2);
    if (size_mm.size() == 2) section.card_size_m = 1e-3 * Eigen::Vector2d(size_mm[0], size_mm[1]);
    if (section.card_size_m &&
        !(section.card_size_m->minCoeff() > 0 && section.card_size_m->maxCoeff() <= k_largest_card_m))
      card->problem(
          fmt::format("expected a width and a height above 0 and at most {} mm.", 1e3 * k_largest_card_m));
  }
  if (const auto colour = node.find("cap_colour")) {
    section.cap_colour = colour->vector3();
    if (section.cap_colour.minCoeff() < 0 || section.cap_colour.maxCoeff() > 1)
      colour->problem("expected linear light from 0 to 1 in red, green and blue.");
  }
  return section;
}

SectionState changed(SectionState state, SectionChange change) {
  switch (change) {
    case SectionChange::toggle:
      return changed(state, state.is_on ? SectionChange::off : SectionChange::on);
    case SectionChange::on:
      state.is_on = true;
      break;
    case SectionChange::off:  // the next `on` begins with the plane that its marker has then
      state.is_on = state.is_held = false;
      state.plane.reset();
      break;
    case SectionChange::hold:
      state.is_on = state.is_held = true;
      break;
    case SectionChange::release:
      state.is_held = false;
      break;
    case SectionChange::flip:
      state.is_flipped = !state.is_flipped;
      if (state.plane) state.plane = flipped(*state.plane);
      break;
    case SectionChange::cover:
      state.is_held = state.is_on && !state.is_held;
      state.is_on = true;
      break;
  }
  return state;
}

CutPlane read_cut_plane(const ConfigNode& node) {
  node.only({"normal", "offset_mm"});
  CutPlane plane;
  const ConfigNode normal = node.at("normal"), offset = node.at("offset_mm");
  plane.normal = normal.vector3();
  plane.offset_m = 1e-3 * offset.number();
  if (!(plane.normal.norm() > 1e-6 && plane.normal.norm() < 1e6)) {
    normal.problem("expected a direction of three numbers, found one without length.");
    return {};
  }
  plane.normal.normalize();
  if (!(std::abs(plane.offset_m) <= 1e-3 * k_largest_offset_mm))
    offset.problem(
        fmt::format("expected at most {} mm, found {}.", k_largest_offset_mm, 1e3 * plane.offset_m));
  return plane;
}

}  // namespace limn::scene
