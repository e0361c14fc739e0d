// ARToolKit template files.
#include "tests/fuzz/fuzz_file.h"
#include "tracker/family.h"
#include "tracker/template_comparison.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "fuzzed.patt");
  const auto families = tracker::Families::load(std::vector{"artoolkit:" + file.string()});
  if (!families) {
    test::check_message(families.message(), file);
    return 0;
  }
  const auto& templates = families->templates();
  LIMN_CHECK(templates.size() == 1 && templates[0].size >= 8);
  for (const tracker::TemplateSimilarity& pair : tracker::compared(templates))
    LIMN_CHECK(std::abs(pair.correlation) < 1.001);
  return 0;
}
