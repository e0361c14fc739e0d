#include "core/program_library.h"

#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "core/data_folder.h"
#include "core/version.h"

namespace limn {
namespace {

std::filesystem::path library_path(const ProgramLibrary& library) {
  if (const char* chosen = std::getenv(library.variable); chosen && *chosen) return chosen;
  return private_library(library.file);
}

}  // namespace

Result<void*> library_function(const ProgramLibrary& library, const char* name) {
  const std::filesystem::path path = library_path(library);
  // It stays loaded, because its threads may still end after its objects are destroyed.
  void* loaded = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  void* stated = loaded ? ::dlsym(loaded, "limn_library_version") : nullptr;
  const std::string found = stated ? reinterpret_cast<const char* (*)()>(stated)() : "none";
  if (loaded && found != version())
    return error(
        "{}: expected {} of Limn {}, found version {}. Install Limn again, or remove {} from the "
        "environment.",
        path.string(), library.purpose, version(), found, library.variable);
  void* function = loaded ? ::dlsym(loaded, name) : nullptr;
  if (function) return function;
  const char* why = ::dlerror();
  return error(
      "{}: expected {}, found: {}. Install Limn again (a build needs the package {}), or name the file in "
      "{}.",
      path.string(), library.purpose, why ? why : "nothing", library.build_package, library.variable);
}

}  // namespace limn
