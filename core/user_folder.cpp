#include "core/user_folder.h"

#include <cstdlib>

namespace limn {

namespace fs = std::filesystem;

Result<fs::path> user_folder() {
  const char* config = std::getenv("XDG_CONFIG_HOME");
  if (config && fs::path(config).is_absolute()) return fs::path(config) / "limn";
  const char* home = std::getenv("HOME");
  if (home && *home) return fs::path(home) / ".config" / "limn";
  return error(
      "expected a folder for Limn's own files, found neither XDG_CONFIG_HOME nor HOME. Set one of them.");
}

}  // namespace limn
