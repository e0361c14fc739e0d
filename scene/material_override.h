#pragma once

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "core/config.h"
#include "core/result.h"

namespace limn::scene {

/// Material values that people chose for a whole part instead of its file's. Textures still multiply the
/// colour, but not the metalness or roughness. With any of these values an unlit part is shaded, too.
struct MaterialOverride {
  std::optional<Eigen::Vector3d> base_colour;  ///< Linear light, 0 … 1.
  std::optional<double> metallic, roughness;   ///< As in glTF, 0 … 1.

  bool is_none() const { return !base_colour && !metallic && !roughness; }
  bool operator==(const MaterialOverride&) const = default;
};

/// Reads text such as "#c02818 0 0.4": a colour (sRGB), metalness and roughness; "-" or nothing keeps the
/// file's value. Error: other words, numbers outside 0 … 1.
Result<MaterialOverride> parse_material_override(const std::string& words);

/// Reads `material` of a slot in a look file. Problems are recorded at the node.
MaterialOverride read_material_override(const ConfigNode& node);
/// The override as JSON for read_material_override(); null for no override.
nlohmann::ordered_json to_json(const MaterialOverride& change);

}  // namespace limn::scene
