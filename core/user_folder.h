#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn {

/// The folder for a user's own settings: $XDG_CONFIG_HOME/limn, else ~/.config/limn. Error: neither
/// XDG_CONFIG_HOME nor HOME is set.
Result<std::filesystem::path> user_folder();

}  // namespace limn
