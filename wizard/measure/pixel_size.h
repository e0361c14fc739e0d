#pragma once

#include <string>

#include "core/result.h"

namespace limn::wizard {

struct PixelSize {
  int width = 0;
  int height = 0;
};

/// Parses a size such as "1280x800"; anything else is a usage error of `option`.
Result<PixelSize> parse_pixel_size(const std::string& text, const std::string& option = "--projector");

}  // namespace limn::wizard
