#pragma once

#include <filesystem>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// The file of the lines that people have drawn in sessions (scene/drawn_lines.h).
constexpr const char* k_drawn_lines_file = "drawn.json";

/// Where sessions keep what people make of a scene (looks/, pairings.json, drawn.json, comments.json): the
/// scene's folder, or, if this user cannot write there, as in a scene that was installed with Limn, a folder
/// of the user for this scene: ~/.local/share/limn/scenes/ and the scene's whole path (user_data_folder() in
/// core/user_folder.h). Without a home it is the scene's folder, where writing fails with a message.
std::filesystem::path kept_folder(const std::filesystem::path& scene_folder);

/// Error, with what to do: neither the scene's folder nor the user's one can be written.
Status check_kept_folder(const std::filesystem::path& scene_folder);

/// The file that a session reads: `name` in kept_folder() if it is there, else in the scene's folder.
std::filesystem::path kept_file(const std::filesystem::path& scene_folder, const std::filesystem::path& name);

/// The files of all looks, sorted by name: those in kept_folder(), and those that came with the scene under
/// other names.
std::vector<std::filesystem::path> look_files(const std::filesystem::path& scene_folder);

}  // namespace limn::scene
