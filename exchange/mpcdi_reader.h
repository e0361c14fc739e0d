#pragma once

#include <filesystem>

#include "core/result.h"
#include "exchange/mpcdi.h"

namespace limn::exchange {

/// Reads an MPCDI archive of version 1 or 2, or its XML alone (as Christie's Mystique writes it:
/// `*.mpcdi.xml`, poses without maps). Lengths become metres. Nothing is unpacked to disk. Errors name the
/// place in the file: it is damaged, something is missing or contradictory, or a map is larger than any
/// projector's.
Result<Mpcdi> read_mpcdi(const std::filesystem::path& path);

}  // namespace limn::exchange
