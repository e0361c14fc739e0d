// Worlds of the virtual rig.
#include "sim/world.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "world.json");
  const auto blank = [](const MarkerName&) -> Result<MarkerDrawing> {
    return MarkerDrawing{cv::Mat(6, 6, CV_8U, cv::Scalar(0))};
  };
  const auto world = sim::load_world(file, blank);
  if (!world) {  // the message names the world or a file that it names
    LIMN_CHECK(!world.message().empty());
    return 0;
  }
  for (const auto* imagers : {&world->rig.cameras, &world->rig.projectors})
    for (const Imager& imager : *imagers) test::check_imager(imager);
  return 0;
}
