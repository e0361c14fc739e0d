#pragma once

#include "core/result.h"

namespace limn::nodes {

/// A function of the shared library with DDS, which is loaded at the first call and stays: the file that the
/// environment variable LIMN_ROOM_ENGINE names, else liblimn_room_dds.so where private_library() expects it
/// (core/data_folder.h). Error: it is not there, or a library that it needs is not installed.
Result<void*> engine_function(const char* name);

}  // namespace limn::nodes
