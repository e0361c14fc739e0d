#include "wizard/measure/pixel_size.h"

#include <charconv>
#include <system_error>

namespace limn::wizard {

Result<PixelSize> parse_pixel_size(const std::string& text, const std::string& option) {
  PixelSize size;
  const char* end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, size.width);
  if (width.ec == std::errc() && width.ptr != end && *width.ptr == 'x') {
    const auto height = std::from_chars(width.ptr + 1, end, size.height);
    if (height.ec == std::errc() && height.ptr == end && size.width > 0 && size.height > 0) return size;
  }
  return usage_error("{}: expected a size such as 1280x800, found '{}'.", option, text);
}

}  // namespace limn::wizard
