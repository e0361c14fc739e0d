#include "apps/patterns.h"

#include <charconv>
#include <opencv2/core/mat.hpp>

#include "calib/patterns.h"
#include "core/file.h"
#include "core/log.h"
#include "core/picture.h"

namespace limn::apps {

Result<PixelSize> parse_pixel_size(const std::string& text) {
  PixelSize size;
  const char* end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, size.width);
  if (width.ec == std::errc() && width.ptr != end && *width.ptr == 'x') {
    const auto height = std::from_chars(width.ptr + 1, end, size.height);
    if (height.ec == std::errc() && height.ptr == end && size.width > 0 && size.height > 0) return size;
  }
  return usage_error("--projector: expected a size such as 1280x800, found '{}'.", text);
}

Status run_patterns(const PatternsOptions& options) {
  LIMN_TRY(const PixelSize size, parse_pixel_size(options.projector));
  const auto patterns = calib::Patterns::create(options.code, size.width, size.height);
  if (!patterns) return usage_error("{}", patterns.message());
  LIMN_TRY_STATUS(make_folder(options.out));
  Progress progress("patterns", patterns->count());
  for (int i = 0; i < patterns->count(); ++i) {
    LIMN_TRY_STATUS(write_png(options.out / calib::picture_name(i), patterns->picture(i)));
    progress.step(i + 1);
  }
  LIMN_TRY_STATUS(calib::save_patterns(*patterns, options.out / "patterns.json"));
  fmt::print("{} pictures of {}x{} in {}\n", patterns->count(), size.width, size.height,
             options.out.string());
  return {};
}

}  // namespace limn::apps
