#include "scene/room_light.h"

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

namespace limn::scene {
namespace {

constexpr double k_most_deg = 360, k_most_light = 10;  // light of a white surface; 1 is full light

Eigen::Vector3d read_direction(const ConfigNode& node) {
  const Eigen::Vector3d d = node.vector3();
  if (std::abs(d.norm() - 1) < 1e-12) return d;  // keeps the digits of the file
  if (d.norm() > 1e-9) return d.normalized();
  node.problem("expected a direction, found a vector of length 0.");
  return Eigen::Vector3d::UnitZ();
}

Eigen::Vector3d read_light_rgb(const ConfigNode& node) {
  const Eigen::Vector3d rgb = node.vector3();
  if (rgb.minCoeff() < 0) node.problem("expected linear light of 0 or more in red, green and blue.");
  return rgb;
}

nlohmann::ordered_json list_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

RoomLight read_room_light(const ConfigNode& node, bool may_have_image) {
  if (may_have_image)
    node.only({"up_world", "soft_below", "soft_above", "lamps", "image", "image_strength"});
  else
    node.only({"up_world", "soft_below", "soft_above", "lamps", "image_strength"});
  RoomLight light;
  light.image_strength = may_have_image && node.find("image") ? 1 : 0;
  if (const auto strength = node.find("image_strength")) {
    light.image_strength = strength->number();
    if (light.image_strength < 0 || light.image_strength > k_most_light)
      strength->problem(fmt::format("expected 0 to {}, found {}.", k_most_light, light.image_strength));
  }
  light.d_up_world = read_direction(node.at("up_world"));
  light.below_rgb = read_light_rgb(node.at("soft_below"));
  light.above_rgb = read_light_rgb(node.at("soft_above"));
  const auto lamps = node.find("lamps");
  for (const ConfigNode& item : lamps ? lamps->items() : std::vector<ConfigNode>()) {
    item.only({"towards_world", "strength"});
    light.lamps.push_back({read_direction(item.at("towards_world")), read_light_rgb(item.at("strength"))});
  }
  if (light.lamps.size() > RoomLight::k_most_lamps)
    lamps->problem(
        fmt::format("expected at most {} lamps, found {}.", RoomLight::k_most_lamps, light.lamps.size()));
  return light;
}

nlohmann::ordered_json to_json(const RoomLight& light) {
  nlohmann::ordered_json lamps = nlohmann::ordered_json::array();
  for (const RoomLight::Lamp& lamp : light.lamps)
    lamps.push_back({{"towards_world", list_of(lamp.d_world)}, {"strength", list_of(lamp.strength_rgb)}});
  nlohmann::ordered_json json = {{"up_world", list_of(light.d_up_world)},
                                 {"soft_below", list_of(light.below_rgb)},
                                 {"soft_above", list_of(light.above_rgb)},
                                 {"lamps", lamps}};
  if (light.image_strength != 0) json["image_strength"] = light.image_strength;
  return json;
}

Result<LightNumbers> light_numbers_of(const std::string& words) {
  std::istringstream text(words);
  double right_deg = 0, up_deg = 0;
  Eigen::Vector3d strengths;  // lamp, above, below
  std::string rest;
  if (!(text >> right_deg >> up_deg >> strengths.x() >> strengths.y() >> strengths.z()) || text >> rest ||
      !(std::abs(right_deg) <= k_most_deg && std::abs(up_deg) <= k_most_deg) ||
      !(strengths.minCoeff() >= 0 && strengths.maxCoeff() <= k_most_light))
    return error(
        "light: expected five numbers: a lamp's degrees to the right and up, its strength, and soft light "
        "from "
        "above and below (0 to {}), found '{}'.",
        k_most_light, words);
  return LightNumbers{right_deg, up_deg, strengths.x(), strengths.y(), strengths.z()};
}

RoomLight parse_room_light(const LightNumbers& numbers,
                           const Eigen::Vector3d& d_up_world,
                           const Eigen::Vector3d& d_front_world) {
  const auto [right_deg, up_deg, strength, above, below] = numbers;
  const Eigen::Vector3d d_up = d_up_world.normalized();
  Eigen::Vector3d d_front = d_front_world - d_front_world.dot(d_up) * d_up;
  d_front = d_front.norm() > 1e-6 ? Eigen::Vector3d(d_front.normalized()) : d_up.unitOrthogonal();
  const double right = right_deg * std::numbers::pi / 180, up = up_deg * std::numbers::pi / 180;
  const Eigen::Vector3d d_level = std::cos(right) * d_front + std::sin(right) * d_up.cross(d_front);
  RoomLight light;
  light.d_up_world = d_up;
  light.above_rgb.setConstant(above);
  light.below_rgb.setConstant(below);
  light.lamps.push_back(
      {(std::cos(up) * d_level + std::sin(up) * d_up).normalized(), Eigen::Vector3d::Constant(strength)});
  return light;
}

}  // namespace limn::scene
