// mrcal's .cameramodel files.
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  limn::test::check_camera(bytes, size, "fuzzed.cameramodel");
  return 0;
}
