#include "scene/material_override.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

#include "core/photometric_response.h"

namespace limn::scene {
namespace {

std::optional<Eigen::Vector3d> colour_of(const std::string& word) {
  unsigned rgb = 0;
  const char* const end = word.data() + word.size();
  if (word.size() != 7 || word[0] != '#') return std::nullopt;
  const auto [at, failed] = std::from_chars(word.data() + 1, end, rgb, 16);
  if (failed != std::errc() || at != end) return std::nullopt;
  return Eigen::Vector3d(limn::linear_from_srgb((rgb >> 16) / 255.0),
                         limn::linear_from_srgb((rgb >> 8 & 255) / 255.0),
                         limn::linear_from_srgb((rgb & 255) / 255.0));
}

std::optional<double> share_of(const std::string& word) {
  double share = 0;
  const char* const end = word.data() + word.size();
  const auto [at, failed] = std::from_chars(word.data(), end, share);
  if (failed != std::errc() || at != end || !(share >= 0 && share <= 1)) return std::nullopt;
  return share;
}

double read_share(const ConfigNode& node) {
  const double share = node.number();
  if (share < 0 || share > 1) node.problem(fmt::format("expected 0 to 1, found {}.", share));
  return share;
}

}  // namespace

Result<MaterialOverride> parse_material_override(const std::string& words) {
  std::istringstream text(words);
  std::vector<std::string> all;
  for (std::string word; text >> word;) all.push_back(word);
  MaterialOverride change;
  bool is_understood = all.size() <= 3;
  for (std::size_t i = 0; i < all.size() && is_understood; ++i) {
    if (all[i] == "-") continue;
    if (i == 0)
      is_understood = (change.base_colour = colour_of(all[i])).has_value();
    else
      is_understood = ((i == 1 ? change.metallic : change.roughness) = share_of(all[i])).has_value();
  }
  if (!is_understood)
    return error(
        "material: expected a colour (#c02818), metalness and roughness from 0 to 1, each or '-', found "
        "'{}'.",
        words);
  return change;
}

MaterialOverride read_material_override(const ConfigNode& node) {
  node.only({"base_colour", "metallic", "roughness"});
  MaterialOverride change;
  if (const auto colour = node.find("base_colour")) {
    change.base_colour = colour->vector3();
    if (change.base_colour->minCoeff() < 0 || change.base_colour->maxCoeff() > 1)
      colour->problem("expected linear light from 0 to 1 in red, green and blue.");
  }
  if (const auto metallic = node.find("metallic")) change.metallic = read_share(*metallic);
  if (const auto roughness = node.find("roughness")) change.roughness = read_share(*roughness);
  return change;
}

nlohmann::ordered_json to_json(const MaterialOverride& change) {
  nlohmann::ordered_json json;
  if (const auto& rgb = change.base_colour) json["base_colour"] = {rgb->x(), rgb->y(), rgb->z()};
  if (change.metallic) json["metallic"] = *change.metallic;
  if (change.roughness) json["roughness"] = *change.roughness;
  return json;
}

}  // namespace limn::scene
