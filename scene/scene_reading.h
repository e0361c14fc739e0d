#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/config.h"
#include "scene/scene.h"

namespace limn::scene {

/// A file that scene.json names. It is read only after the whole scene.json was found valid.
struct MeshFile {
  std::string where;  ///< Its key in scene.json, for errors.
  std::filesystem::path path;
  std::optional<LengthUnit> units;  ///< absent: the file's own
  bool is_volume = false;           ///< A volume instead of a mesh.
  double scale = 1;                 ///< The size of a volume as a multiple of the file's.
  std::optional<GreyWindow> window = {};
};

/// The files of a scene that are still to be loaded.
struct SceneFiles {
  std::vector<MeshFile> part_meshes;  ///< in the order of slots and variants
  std::optional<MeshFile> prototype_mesh;
  std::optional<std::filesystem::path> albedo_image;
};

/// Reads scene.json: all of a scene but what lies in the files that it names. Errors are problems of the
/// nodes.
Scene read_scene(const ConfigNode& root, SceneFiles* files);

/// Reads a viewer that stands at a fixed place.
Imager read_viewer_imager(const ConfigNode& node);

}  // namespace limn::scene
