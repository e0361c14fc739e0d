#pragma once

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "core/config.h"
#include "core/result.h"

namespace limn::scene {

/// What people want otherwise of a whole part than its file says; textures still multiply the colour, but not
/// the metalness or roughness. An unlit part is lit once one of these is given.
struct MaterialOverride {
  std::optional<Eigen::Vector3d> base_colour;  ///< linear light, 0 … 1
  std::optional<double> metallic, roughness;   ///< glTF's, 0 … 1

  bool is_none() const { return !base_colour && !metallic && !roughness; }
  bool operator==(const MaterialOverride&) const = default;
};

/// In a person's words: "#c02818 0 0.4" is a colour (sRGB), metalness and roughness; "-", or nothing, for
/// what the file says. Error: other words, numbers outside 0 … 1.
Result<MaterialOverride> parse_material_override(const std::string& words);

/// `material` of a slot in a look. Problems are noted at the node.
MaterialOverride read_material_override(const ConfigNode& node);
/// The same back; null for none.
nlohmann::ordered_json to_json(const MaterialOverride& change);

}  // namespace limn::scene
