#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn {

/// The folder for a user's own settings: $XDG_CONFIG_HOME/limn, else ~/.config/limn. Error: neither
/// XDG_CONFIG_HOME nor HOME is set, or the home does not exist.
Result<std::filesystem::path> user_folder();

/// The folder for what a user makes with Limn: $XDG_DATA_HOME/limn, else ~/.local/share/limn. Errors: as
/// for user_folder().
Result<std::filesystem::path> user_data_folder();

/// The folder for files that may be deleted at any time: $XDG_CACHE_HOME/limn, else ~/.cache/limn. Errors:
/// as for user_folder().
Result<std::filesystem::path> user_cache_folder();

}  // namespace limn
