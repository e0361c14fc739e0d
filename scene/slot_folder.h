#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace limn::scene {

/// What lies in a slot's folder.
struct SlotFolder {
  /// A file or folder that is not taken.
  struct Other {
    std::filesystem::path path;
    std::string why;  ///< What it is, and what to do.
  };
  /// Files of meshes and volumes, and folders of DICOM slices, in the order of their names.
  std::vector<std::filesystem::path> meshes;
  std::vector<Other> others;  ///< In the order of their names.
};

/// Whether it is a volume: a NIfTI file, or a folder with DICOM slices.
bool is_volume(const std::filesystem::path& path);

/// Lists a slot's folder; an absent folder is empty. What belongs to meshes (textures, .mtl, .bin, folders
/// without meshes), hidden and temporary files and units.json are in neither list.
SlotFolder list_slot_folder(const std::filesystem::path& folder);

}  // namespace limn::scene
