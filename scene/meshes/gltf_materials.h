#pragma once

#include "scene/files/gltf_file.h"
#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// The materials of a glTF file with the images inside it. Metalness and roughness, or
/// KHR_materials_pbrSpecularGlossiness (its diffuse colour; neither is a metal). Warns of extensions that
/// change the look and are not shown. A last material is glTF's own, for primitives that name none.
Status read_gltf_materials(GltfFile* file, MeshContent* content);

}  // namespace limn::scene
