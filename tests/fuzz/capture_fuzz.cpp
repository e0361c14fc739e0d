// capture.json.
#include <string_view>

#include "calib/capture_set.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  constexpr std::string_view k_patterns =
      R"({"schema": "limn.patterns/1", "code": "gray", "size": [8, 4], "pictures": 12})";
  test::fuzzed_file(reinterpret_cast<const std::uint8_t*>(k_patterns.data()), k_patterns.size(),
                    "patterns.json");
  const auto file = test::fuzzed_file(bytes, size, "capture.json");
  const auto captures = calib::load_captures(file.parent_path());
  if (!captures) LIMN_CHECK(captures.message().find(file.parent_path().string()) != std::string::npos);
  return 0;
}
