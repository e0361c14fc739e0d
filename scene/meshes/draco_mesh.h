#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// The vertices and triangles of a Draco-compressed mesh.
struct DracoMesh {
  /// The numbers of each attribute that was asked for, one entry for each vertex.
  std::map<std::string, std::vector<float>> attributes;
  std::map<std::string, std::size_t> components;  ///< Numbers in each entry.
  std::vector<std::uint32_t> indices;             ///< Three for each triangle.
};

/// Decodes a mesh (KHR_draco_mesh_compression). `ids` are Draco's numbers of the attributes, by their names
/// in glTF. Error: damaged data, a missing attribute,
/// no library with Draco.
Result<DracoMesh> decode_draco(std::string_view bytes, const std::map<std::string, std::size_t>& ids);

}  // namespace limn::scene
