// response.json.
#include "core/photometric_response.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "response.json");
  test::check_read(load_responses(file), file);
  const auto mixing = load_mixing(file, "projector0", "camera0");
  if (!mixing) LIMN_CHECK(mixing.message().find(file.parent_path().string()) != std::string::npos);
  return 0;
}
