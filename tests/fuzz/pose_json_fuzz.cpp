// Poses as JSON.
#include "exchange/poses/pose_json.h"
#include "tests/fuzz/fuzz_poses.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  test::check_decoded(exchange::poses_of_json({reinterpret_cast<const char*>(bytes), size}));
  return 0;
}
