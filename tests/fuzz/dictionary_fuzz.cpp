// OpenCV dictionary files.
#include "tests/fuzz/fuzz_file.h"
#include "tracker/family.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "fuzzed.yml");
  const auto families = tracker::Families::load(std::vector{"aruco:" + file.string()});
  if (!families) {
    test::check_message(families.message(), file);
    return 0;
  }
  LIMN_CHECK(families->codes().size() == 1);
  const tracker::CodeFamily& family = families->codes()[0];
  LIMN_CHECK(!family.codes.empty() && !family.max_errors.empty());
  for (const auto& turns : family.codes)
    for (const std::uint64_t code : turns) LIMN_CHECK(code >> (family.cells * family.cells) == 0);
  return 0;
}
