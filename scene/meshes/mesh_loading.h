#pragma once

#include <filesystem>
#include <optional>

#include "core/result.h"
#include "scene/meshes/cad_file.h"
#include "scene/meshes/mesh.h"

namespace limn::scene {

/// As load_mesh_with_variants() of scene/meshes/mesh.h; `wait` says what is done about a CAD file.
Result<MeshWithVariants> load_mesh_with_variants(const std::filesystem::path& path,
                                                 std::optional<LengthUnit> units,
                                                 const CadWait& wait);

/// Likewise for load_mesh() of scene/meshes/mesh.h.
Result<Mesh> load_mesh(const std::filesystem::path& path,
                       std::optional<LengthUnit> units,
                       const CadWait& wait);

}  // namespace limn::scene
