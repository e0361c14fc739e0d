// Viewer files.
#include "scene/scene.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "viewer.json");
  const auto viewer = scene::load_viewer(file);
  test::check_read(viewer, file);
  if (viewer) test::check_imager(*viewer);
  return 0;
}
