// Packets of PosiStageNet.
#include "exchange/poses/posi_stage_net.h"
#include "tests/fuzz/fuzz_poses.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  test::check_decoded(exchange::psn_packet({bytes, size}));
  return 0;
}
