// OpenCV camera files.
#include "core/imager_file.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "fuzzed.yml");
  const auto imager = load_imager(file);
  if (imager)
    test::check_imager(*imager);
  else
    test::check_message(imager.message(), file);
  return 0;
}
