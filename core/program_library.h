#pragma once

#include "core/result.h"

/// Each such library has this line in one of its files, so that one of another version of Limn is refused.
#define LIMN_LIBRARY_VERSION(version)                                                   \
  extern "C" __attribute__((visibility("default"))) const char* limn_library_version(); \
  extern "C" __attribute__((visibility("default"))) const char* limn_library_version() { return version; }

namespace limn {

/// A shared library that comes with the program and is loaded only when it is needed.
struct ProgramLibrary {
  const char* file;           ///< `liblimn_video.so`
  const char* variable;       ///< The environment variable that may name another file.
  const char* purpose;        ///< For messages: "the engine that …".
  const char* build_package;  ///< The Debian package that a build needs for it.
};

/// A function of the library, which is loaded at the first call and stays: the file that the variable names,
/// else the one where private_library() expects it (core/data_folder.h). Errors: it is not there; a library
/// that it needs is not installed; it belongs to another version of Limn.
Result<void*> library_function(const ProgramLibrary& library, const char* name);

}  // namespace limn
