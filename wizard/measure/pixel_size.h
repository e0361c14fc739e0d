#pragma once

#include <string>

#include "core/result.h"

namespace limn::apps {

struct PixelSize {
  int width = 0;
  int height = 0;
};

/// "1280x800" as numbers; anything else is wrong usage of --projector.
Result<PixelSize> parse_pixel_size(const std::string& text);

}  // namespace limn::apps
