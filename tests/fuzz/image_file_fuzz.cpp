// Image files of all formats, as they come from a disk.
#include <algorithm>
#include <opencv2/core.hpp>

#include "core/image_io.h"
#include "core/log.h"
#include "tests/fuzz/fuzz_file.h"

namespace {

using namespace limn;

// Every file is an image of 8 bits, or refused with a message that names it.
void check(std::string_view bytes, const ImageOptions& options) {
  const auto image = decode_image(bytes, "input", options);
  if (!image) {
    LIMN_CHECK(image.message().starts_with("input: expected"));
    return;
  }
  LIMN_CHECK(image->cols > 0 && image->rows > 0 && std::max(image->cols, image->rows) <= k_max_image_side);
  LIMN_CHECK(static_cast<long>(image->cols) * image->rows <= k_max_image_pixels);
  const bool has_alpha = image->type() == CV_8UC4 && options.alpha == Alpha::kept;
  LIMN_CHECK(image->type() == CV_8UC1 || (!options.grey && (image->type() == CV_8UC3 || has_alpha)));
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  set_log_level(LogLevel::quiet);
  const std::string_view file(reinterpret_cast<const char*>(bytes), size);
  check(file, {.alpha = Alpha::kept});
  check(file, {.grey = true, .used_bits = k_found_in_image});
  return 0;
}
