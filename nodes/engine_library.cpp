#include "nodes/engine_library.h"

#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>

#include "core/data_folder.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;

constexpr const char *k_library = "liblimn_room_dds.so", *k_variable = "LIMN_ROOM_ENGINE";

fs::path engine_path() {
  if (const char* chosen = std::getenv(k_variable); chosen && *chosen) return chosen;
  return private_library(k_library);
}

}  // namespace

Result<void*> engine_function(const char* name) {
  const fs::path path = engine_path();
  // It stays loaded, because its threads may still end after the engine is destroyed.
  void* library = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  void* function = library ? ::dlsym(library, name) : nullptr;
  if (function) return function;
  const char* why = ::dlerror();
  return error(
      "{}: expected the engine that connects the machines of a room and ROS 2, found: {}. Install Limn again "
      "(a build needs the package cyclonedds-dev), or name the file in {}.",
      path.string(), why ? why : "nothing", k_variable);
}

}  // namespace limn::nodes
