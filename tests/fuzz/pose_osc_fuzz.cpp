// Poses by Open Sound Control.
#include "exchange/poses/pose_osc.h"
#include "tests/fuzz/fuzz_poses.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  test::check_decoded(exchange::poses_of_osc({bytes, size}));
  return 0;
}
