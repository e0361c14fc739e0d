// Scripts of a virtual session.
#include "session/requests/script.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const auto file = limn::test::fuzzed_file(bytes, size, "script.json");
  limn::test::check_read(limn::session::load_script(file), file);
  return 0;
}
