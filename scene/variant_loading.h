#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "core/result.h"
#include "scene/meshes/mesh_loading.h"
#include "scene/scene.h"
#include "scene/scene_reading.h"

namespace limn::scene {

/// What is left out of a scene: variants that cannot be loaded, and files that are none.
struct LeftOut {
  std::vector<SkippedVariant> variants, others;
};

/// Loads the mesh of a file that the scene names. Error: with the file's key in scene.json, also for a mesh
/// much too small or large for an object.
Result<Mesh> load_listed_mesh(const MeshFile& file,
                              const std::filesystem::path& scene_path,
                              const CadWait& wait);

/// Loads the variants that scene.json lists, and the meshes in slots/NAME/. Those that cannot be loaded are
/// left out. Error: units.json cannot be read.
Status load_variants(std::span<const MeshFile> listed,
                     const std::filesystem::path& path,
                     const std::filesystem::path& scene_folder,
                     const CadWait& wait,
                     Slot* slot,
                     LeftOut* left_out);

/// Adds what lies in slots/ itself, and folders there that no slot is named after.
void find_strays(const Scene& scene, LeftOut* left_out);

}  // namespace limn::scene
