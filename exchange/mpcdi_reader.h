#pragma once

#include <filesystem>

#include "core/result.h"
#include "exchange/mpcdi.h"

namespace limn::exchange {

/// What is read of an MPCDI file.
enum class MpcdiParts {
  all,
  poses  ///< The regions without their maps, which may be damaged or not be there.
};

/// Reads an MPCDI archive of version 1 or 2, or its XML alone (as Christie's Mystique writes it:
/// `*.mpcdi.xml`, poses without maps). Lengths become metres. Nothing is unpacked to disk. Errors name the
/// place in the file: it is damaged, something is missing or contradictory (a region has neither a warp nor a
/// frustum with a coordinateFrame), or a map is larger than any projector's.
Result<Mpcdi> read_mpcdi(const std::filesystem::path& path, MpcdiParts parts = MpcdiParts::all);

}  // namespace limn::exchange
