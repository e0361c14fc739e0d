// scene.json.
#include "scene/scene.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const auto file = limn::test::fuzzed_file(bytes, size, "scene.json");
  limn::test::check_read(limn::scene::load_scene(file), file);
  return 0;
}
