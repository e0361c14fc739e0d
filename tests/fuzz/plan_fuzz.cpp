// Plans of a calibration.
#include "tests/fuzz/fuzz_file.h"
#include "wizard/capture/capture_plan.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const auto file = limn::test::fuzzed_file(bytes, size, "plan.json");
  limn::test::check_read(limn::wizard::load_plan(file), file);
  return 0;
}
