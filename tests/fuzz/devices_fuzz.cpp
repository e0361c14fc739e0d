// Devices files.
#include "device/devices_file.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const auto file = limn::test::fuzzed_file(bytes, size, "devices.json");
  limn::test::check_read(limn::device::load_devices(file), file);
  return 0;
}
