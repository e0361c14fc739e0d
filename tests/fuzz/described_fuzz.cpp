// Descriptions of rigs that are to be bought.
#include "tests/fuzz/fuzz_file.h"
#include "wizard/design/rig_description.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "described.json");
  const auto described = design::load_described(file);
  test::check_read(described, file);
  if (!described) return 0;
  LIMN_CHECK(described->p_centre.allFinite() && described->size_m.allFinite() && described->poses > 0);
  for (const auto* imagers : {&described->rig.cameras, &described->rig.projectors})
    for (const Imager& imager : *imagers) test::check_imager(imager);
  return 0;
}
