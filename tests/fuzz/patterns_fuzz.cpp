// patterns.json.
#include "calib/code/patterns.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "patterns.json");
  const auto patterns = calib::load_patterns(file);
  test::check_read(patterns, file);
  if (patterns) LIMN_CHECK(patterns->count() > 0);
  return 0;
}
