#pragma once

#include <filesystem>

#include "core/result.h"

struct aiScene;
namespace Assimp {
class Importer;
}

namespace limn::scene {

/// Reads a mesh file as triangles, without its points and lines. The scene belongs to `importer`; null:
/// assimp refuses the file, and the importer says why.
const aiScene* read_with_assimp(const std::filesystem::path& path, Assimp::Importer* importer);

/// Calls read_with_assimp() in a child process and drops the result. On some damaged files assimp
/// crashes, never ends or takes all memory; this must not happen to the program itself. Error: the reader
/// crashed, took more than a second and half a second for each megabyte, or needed more memory than such a
/// file can justify. A file that assimp refuses by itself is no error here. One trial runs at a time.
Status try_mesh_reader(const std::filesystem::path& path);

}  // namespace limn::scene
