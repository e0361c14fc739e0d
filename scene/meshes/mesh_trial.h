#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::scene {

/// Calls read_mesh_content() in a child process and drops the result. On some damaged files a library
/// crashes, never ends or takes all memory; this must not happen to the program itself. Error: the reader
/// crashed, took more than a second and half a second for each megabyte (two where it may be compressed), or
/// needed more memory than such a file can justify. A file that the reader refuses by itself is no error
/// here. Only one trial may run at a time, and no other thread may be inside a mesh library meanwhile.
Status try_mesh_reader(const std::filesystem::path& path);

}  // namespace limn::scene
