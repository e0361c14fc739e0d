#pragma once

#include <filesystem>

#include "core/result.h"
#include "exchange/mpcdi.h"

namespace limn::exchange {

/// Writes an archive of MPCDI 2.0: mpcdi.xml, and the maps as PFM and PNG. The file at `path` is replaced
/// only when the new one is complete.
Status write_mpcdi(const std::filesystem::path& path, const Mpcdi& mpcdi);

}  // namespace limn::exchange
