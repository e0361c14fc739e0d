#pragma once

#include <filesystem>
#include <string>

#include "core/result.h"
#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// Reads a mesh file, in the format that its name ends in. Errors: an unknown format, a file that is not
/// whole, an extension of the format that is needed and not known. Messages begin with the path.
Result<MeshContent> read_mesh_content(const std::filesystem::path& path);

/// Whether files of this name's format state their unit: glTF, FBX, COLLADA, 3MF, AMF, STEP, IGES.
bool states_unit(const std::filesystem::path& path);
/// Whether a file of this name is a mesh that Limn reads.
bool is_mesh_name(const std::filesystem::path& path);
/// The mesh formats, for messages.
std::string mesh_formats();

}  // namespace limn::scene
