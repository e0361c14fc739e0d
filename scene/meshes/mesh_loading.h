#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>

#include "core/result.h"
#include "scene/meshes/mesh.h"

namespace limn::scene {

/// As load_mesh_with_variants() of scene/meshes/mesh.h; the reading of a CAD file, which may take minutes, ends
/// with an error when `stop` is requested.
Result<MeshWithVariants> load_mesh_with_variants(const std::filesystem::path& path,
                                                 std::optional<LengthUnit> units,
                                                 const std::stop_token& stop);

/// Likewise for load_mesh() of scene/meshes/mesh.h.
Result<Mesh> load_mesh(const std::filesystem::path& path,
                       std::optional<LengthUnit> units,
                       const std::stop_token& stop);

}  // namespace limn::scene
