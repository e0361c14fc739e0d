#pragma once

#include "core/result.h"

namespace limn {

/// A shared library that comes with the program and is loaded only when it is needed.
struct ProgramLibrary {
  const char* file;           ///< `liblimn_video.so`
  const char* variable;       ///< The environment variable that may name another file.
  const char* purpose;        ///< For messages: "the engine that …".
  const char* build_package;  ///< The Debian package that a build needs for it.
};

/// A function of the library, which is loaded at the first call and stays: the file that the variable names,
/// else the one where private_library() expects it (core/data_folder.h). Error: it is not there, or a library
/// that it needs is not installed.
Result<void*> library_function(const ProgramLibrary& library, const char* name);

}  // namespace limn
