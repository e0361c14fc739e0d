#pragma once

#include <optional>
#include <string>

#include "core/result.h"

namespace limn::validate {

/// The bytes of a JPEG file without comments and metadata (EXIF, XMP and others), where cameras put names,
/// places and serial numbers. The pixels are as before. nullopt: there is nothing to take out. Error: the
/// bytes are no JPEG whose parts can be told apart, so that they may hold anything.
Result<std::optional<std::string>> without_metadata(const std::string& jpeg);

}  // namespace limn::validate
