// A deviation from the CAD as bytes: the file `deviation` of a recording and of a node machine's setup.
#include "scene/deviation_layer.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const std::string_view text(reinterpret_cast<const char*>(bytes), size);
  const auto layer = scene::deviation_layer_of(text);
  if (!layer) {
    test::check_message(layer.message());
    return 0;
  }
  LIMN_CHECK(scene::bytes_of(*layer) == text);
  for (const scene::DeviationLayer::Triangle& triangle : layer->triangles)
    LIMN_CHECK(triangle.first + scene::points_of_divisions(triangle.divisions) <= layer->values.size());
  return 0;
}
