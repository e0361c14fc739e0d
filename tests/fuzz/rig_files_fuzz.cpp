// Rigs that other programs calibrated. A line of %% divides the bytes into two files.
#include <string_view>

#include "exchange/rig_files.h"
#include "tests/fuzz/fuzz_file.h"

namespace {

using namespace limn;

void check(const std::vector<std::filesystem::path>& files, const exchange::RigFileOptions& options) {
  const auto read = exchange::read_rig_files(files, options);
  if (!read) {
    LIMN_CHECK(read.message().find("expected") != std::string::npos);
    return;
  }
  LIMN_CHECK(read->rig.cameras.size() + read->rig.projectors.size() > 0 && !read->program.empty());
  for (const auto* imagers : {&read->rig.cameras, &read->rig.projectors})
    for (const Imager& imager : *imagers) test::check_imager(imager);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  constexpr std::string_view k_line = "\n%%\n";
  const std::size_t end = std::string_view(reinterpret_cast<const char*>(bytes), size).find(k_line);
  std::vector<std::filesystem::path> files = {test::fuzzed_file(bytes, std::min(end, size), "rig.file")};
  if (end < size) {
    const std::size_t next = end + k_line.size();
    files.push_back(test::fuzzed_file(bytes + next, size - next, "second.file"));
  }
  check(files, {});  // files that state units and sizes
  check(files, {scene::LengthUnit::millimetre, std::array{1280, 1024}, std::array{1024, 768}});
  return 0;
}
