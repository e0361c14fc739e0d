// PFM images.
#include "exchange/pfm.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  constexpr std::int64_t k_most_pixels = 1 << 16;
  const auto image =
      exchange::read_pfm({reinterpret_cast<const char*>(bytes), size}, "map.pfm", k_most_pixels);
  if (image)
    LIMN_CHECK(image->total() <= k_most_pixels && image->total() * 12 <= size);
  else
    test::check_message(image.message(), "map.pfm");
  return 0;
}
