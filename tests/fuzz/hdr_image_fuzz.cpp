// Images of linear light: Radiance and OpenEXR.
#include <opencv2/core.hpp>

#include "scene/files/hdr_image.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto image = scene::decode_hdr_image({reinterpret_cast<const char*>(bytes), size}, "room.hdr");
  if (image)
    LIMN_CHECK(cv::checkRange(*image, true, nullptr, 0, scene::k_most_hdr_light + 1));
  else
    test::check_message(image.message(), "room.hdr");
  return 0;
}
