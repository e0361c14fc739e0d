// Poses as JSON.
#include "core/utf8.h"
#include "exchange/poses/pose_json.h"
#include "tests/fuzz/fuzz_file.h"
#include "tests/fuzz/fuzz_poses.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto read = exchange::poses_of_json({reinterpret_cast<const char*>(bytes), size});
  if (!read) {
    LIMN_CHECK(read.message().find("expected") != std::string::npos);
    LIMN_CHECK(is_utf8(read.message()));
    return 0;
  }
  test::check_poses(*read);
  return 0;
}
