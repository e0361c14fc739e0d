#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "scene/files/gltf_file.h"
#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// The names of a file's material variants (glTF's KHR_materials_variants). A name that is missing or occurs
/// again gets a number. Errors: data of another form, far too many variants. Throws as GltfFile does.
Result<std::vector<std::string>> read_variant_names(const GltfFile& file);

/// Writes the materials that a primitive has in the variants to the piece, whose `variant_materials` hold its
/// own material for each. `materials` is the number of the file's materials. Errors: a variant or material
/// that the file does not have. Throws as GltfFile does.
Status read_variant_materials(const GltfFile& file,
                              const nlohmann::json& primitive,
                              std::size_t materials,
                              MeshPiece* piece);

}  // namespace limn::scene
