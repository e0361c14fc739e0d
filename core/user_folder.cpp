#include "core/user_folder.h"

#include <cstdlib>

namespace limn {

namespace fs = std::filesystem;
namespace {

// The folder that a variable names, else one in the home folder.
Result<fs::path> folder_of(const char* variable, const char* in_home) {
  const char* named = std::getenv(variable);
  if (named && fs::path(named).is_absolute()) return fs::path(named) / "limn";
  const char* home = std::getenv("HOME");
  if (!home || !*home)
    return error("expected a folder for Limn's own files, found neither {} nor HOME. Set one of them.",
                 variable);
  std::error_code ignored;
  if (!fs::is_directory(home, ignored))
    return error(
        "{}: expected the user's home folder (HOME), found none. Make it, or set {} to another folder.", home,
        variable);
  return fs::path(home) / in_home / "limn";
}

}  // namespace

Result<fs::path> user_folder() { return folder_of("XDG_CONFIG_HOME", ".config"); }

Result<fs::path> user_data_folder() { return folder_of("XDG_DATA_HOME", ".local/share"); }

Result<fs::path> user_cache_folder() { return folder_of("XDG_CACHE_HOME", ".cache"); }

}  // namespace limn
