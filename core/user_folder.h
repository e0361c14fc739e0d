#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn {

/// The folder for what Limn keeps of one person: $XDG_CONFIG_HOME/limn, else ~/.config/limn. Error: neither
/// variable says where.
Result<std::filesystem::path> user_folder();

}  // namespace limn
