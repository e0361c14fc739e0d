// Messages of FreeD.
#include "exchange/poses/free_d.h"
#include "tests/fuzz/fuzz_poses.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  test::check_decoded(exchange::pose_of_free_d({bytes, size}));
  return 0;
}
