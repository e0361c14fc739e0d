#include "scene/command_text.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/photometric_response.h"

namespace limn::scene {
namespace {

double rounded(double value, double step) { return std::round(value / step) * step; }

bool is_white(const Eigen::Vector3d& rgb) { return rgb.maxCoeff() - rgb.minCoeff() < 1e-9; }

int level_of(double light) {
  return static_cast<int>(std::lround(255 * std::clamp(srgb_from_linear(light), 0.0, 1.0)));
}

}  // namespace

std::string listed(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list.empty() ? "none" : list;
}

std::string format_material_override(const MaterialOverride& change) {
  if (change.is_none()) return {};
  const auto share = [](const std::optional<double>& value) {
    return value ? fmt::format("{:.3g}", *value) : std::string("-");
  };
  const auto& rgb = change.base_colour;
  return fmt::format(
      "{} {} {}",
      rgb ? fmt::format("#{:02x}{:02x}{:02x}", level_of(rgb->x()), level_of(rgb->y()), level_of(rgb->z()))
          : "-",
      share(change.metallic), share(change.roughness));
}

std::optional<LightNumbers> room_light_numbers(const RoomLight& light, const Eigen::Vector3d& d_front_world) {
  if (light.lamps.size() != 1 || !is_white(light.lamps[0].strength_rgb) || !is_white(light.above_rgb) ||
      !is_white(light.below_rgb))
    return std::nullopt;
  // The directions of a lamp in front and of one 90 degrees to the right of it.
  const auto lamp_at = [&](const LightNumbers& numbers) {
    return parse_room_light(numbers, light.d_up_world, d_front_world).lamps[0].d_world;
  };
  const Eigen::Vector3d d_front = lamp_at({0, 0, 1, 0, 0}), d_right = lamp_at({90, 0, 1, 0, 0});
  const Eigen::Vector3d& d_lamp = light.lamps[0].d_world;
  const double degrees = 180 / std::numbers::pi;
  const double up = std::asin(std::clamp(d_lamp.dot(light.d_up_world), -1.0, 1.0));
  const double right = std::atan2(d_lamp.dot(d_right), d_lamp.dot(d_front));
  return LightNumbers{rounded(degrees * right, 0.1), rounded(degrees * up, 0.1),
                      rounded(light.lamps[0].strength_rgb.x(), 1e-3), rounded(light.above_rgb.x(), 1e-3),
                      rounded(light.below_rgb.x(), 1e-3)};
}

}  // namespace limn::scene
