// PLY files of points and surfaces.
#include "scene/meshes/scan_surface.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "cloud.ply");
  const auto surface = scene::load_ply(file);
  test::check_read(surface, file);
  if (!surface) return 0;
  for (const auto& triangle : surface->triangles)
    for (const std::uint32_t vertex : triangle) LIMN_CHECK(vertex < surface->positions.size());
  return 0;
}
