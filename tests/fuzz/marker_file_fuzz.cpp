// Poses of a body's markers.
#include "scene/marker_file.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "markers.json");
  const auto markers = scene::load_marker_file(file);
  test::check_read(markers, file);
  if (!markers) return 0;
  for (const BodyMarker& marker : *markers)
    LIMN_CHECK(marker.size_m > 0 && std::isfinite(marker.size_m) && marker.body_from_marker.is_finite());
  static_cast<void>(scene::marker_file_json(*markers));
  return 0;
}
