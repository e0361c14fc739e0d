#pragma once

#include <filesystem>

#include "core/result.h"
#include "exchange/mpcdi.h"

namespace limn::apps {

/// Writes an archive of MPCDI 2.0: mpcdi.xml, the maps as PFM and PNG. `path` is either old or complete.
Status write_mpcdi(const std::filesystem::path& path, const Mpcdi& mpcdi);

}  // namespace limn::apps
