#include "remote/glasses/glasses_messages.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/json_text.h"
#include "remote/glasses/part_cut.h"

namespace limn::remote {
namespace {

using nlohmann::ordered_json;

constexpr double k_place_steps = 1e5;  // per metre and per unit of a quaternion
constexpr int k_outline_points = 12;   // on each side of a projector's image
constexpr double k_tangent_steps = 1e6;

double rounded_to(double value, double steps) { return std::round(value * steps) / steps; }

// [w, x, y, z, tx, ty, tz]
ordered_json short_pose(const Pose& pose, double steps) {
  const Eigen::Quaterniond& q = pose.rotation;
  const Eigen::Vector3d& t = pose.translation;
  ordered_json out = ordered_json::array();
  for (const double value : {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()})
    out.push_back(rounded_to(value, steps));
  return out;
}

// The upper triangle, row by row, to two digits or so.
ordered_json short_covariance(const Matrix6d& covariance) {
  ordered_json out = ordered_json::array();
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column)
      out.push_back(ordered_json::parse(fmt::format("{:.1e}", covariance(row, column))));
  return out;
}

}  // namespace

std::string glasses_message(const GlassesRegistration& registration,
                            const std::string& marker,
                            std::span<const std::string> markers) {
  ordered_json out = {{"type", "glasses"},
                      {"state", k_glasses_states.text(registration.state())},
                      {"why", registration.advice()},
                      {"marker", marker},
                      {"markers", std::vector<std::string>(markers.begin(), markers.end())}};
  if (const auto& place = registration.place()) {
    out["world_from_feed"] = short_pose(place->world_from_feed, k_place_steps);
    out["covariance"] = short_covariance(place->covariance);
    out["eye_stddev_mm"] = rounded_to(1e3 * place->eye_stddev_m, 10);
    out["eye_stddev_deg"] = rounded_to(place->eye_stddev_rad * 180 / std::numbers::pi, 100);
  }
  return json_text(out);
}

std::string glasses_parts_message(const scene::PosedScene& posed, const scene::Scene& scene, int number) {
  ordered_json out = {{"type", "glasses_parts"}, {"scene", number}, {"prototype", nullptr}};
  if (posed.world_from_prototype) out["prototype"] = short_pose(*posed.world_from_prototype, k_place_steps);
  out["parts"] = ordered_json::array();
  for (const scene::PosedPart& part : posed.parts) {
    const scene::Slot* slot = scene.find_slot(part.slot);
    if (!slot) continue;
    out["parts"].push_back({part.slot, part.variant, short_pose(part.world_from_part, k_place_steps),
                            slot->mode == scene::Mode::surface ? "surface" : "view"});
    if (posed.cut && scene.section && scene.section->cuts(part.slot))
      out["parts"].back().push_back(
          part_cut_json(*scene.section, scene::transformed(part.world_from_part.inverse(), *posed.cut),
                        1 + static_cast<int>(slot - scene.slots.data())));
  }
  return json_text(out);
}

std::string glasses_light_json(const Rig& rig) {
  ordered_json out = {{"projectors", ordered_json::array()}};
  for (const Imager& projector : rig.projectors) {
    ordered_json outline = ordered_json::array();
    const Eigen::Vector2d first(-0.5, -0.5), last(projector.width - 0.5, projector.height - 0.5);
    const Eigen::Vector2d corners[] = {first, {last.x(), first.y()}, last, {first.x(), last.y()}};
    for (int side = 0; side < 4; ++side)
      for (int i = 0; i < k_outline_points; ++i) {
        const double along = static_cast<double>(i) / k_outline_points;
        const Eigen::Vector2d px = (1 - along) * corners[side] + along * corners[(side + 1) % 4];
        const auto d = projector.lens.unproject(px);
        if (!d || !(d->z() > 0)) continue;
        outline.push_back(
            {rounded_to(d->x() / d->z(), k_tangent_steps), rounded_to(d->y() / d->z(), k_tangent_steps)});
      }
    out["projectors"].push_back(
        {{"name", projector.name},
         {"world_from_projector", short_pose(projector.imager_from_world.inverse(), 10 * k_place_steps)},
         {"outline", outline}});
  }
  return json_text(out);
}

}  // namespace limn::remote
