// session.json of a recording. Its events are read line by line as JSON.
#include "session/recording.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const auto file = test::fuzzed_file(bytes, size, "session.json");
  const auto setup = session::load_setup(file.parent_path());
  if (!setup) LIMN_CHECK(setup.message().find(file.parent_path().string()) != std::string::npos);
  return 0;
}
