#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::scene {

/// How assimp reads a mesh: its aiPostProcessSteps.
extern const unsigned k_mesh_reader_steps;

/// Reads a mesh file with assimp in a child process and drops the result. On some damaged files assimp
/// crashes, never ends or takes all memory; this must not happen to the program itself. Error: the reader
/// crashed, took more than a second and half a second for each megabyte, or needed more memory than such a
/// file can justify. A file that assimp refuses by itself is no error here. One trial runs at a time.
Status try_mesh_reader(const std::filesystem::path& path);

}  // namespace limn::scene
