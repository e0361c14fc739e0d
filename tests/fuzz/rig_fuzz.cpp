// rig.json.
#include "core/rig.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "rig.json");
  const auto rig = load_rig(file);
  if (!rig) {
    test::check_message(rig.message(), file);
    return 0;
  }
  for (const auto* imagers : {&rig->cameras, &rig->projectors})
    for (const Imager& imager : *imagers) test::check_imager(imager);
  return 0;
}
