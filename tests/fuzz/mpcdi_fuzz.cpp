// MPCDI, as an archive or only its XML. An archive's checksums would reject every mutation inside it. So
// lines of %% also divide the bytes into files, which are then packed: mpcdi.xml, then 1, 2, … for maps.
#include "exchange/mpcdi_reader.h"
#include "exchange/zip.h"
#include "tests/fuzz/fuzz_file.h"

namespace {

using namespace limn;

void check(const std::string& bytes) {
  const auto file =
      test::fuzzed_file(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), "head.mpcdi");
  const auto mpcdi = exchange::read_mpcdi(file);
  if (!mpcdi) {
    test::check_message(mpcdi.message(), file);
    return;
  }
  LIMN_CHECK(!mpcdi->regions.empty());
  for (const exchange::MpcdiRegion& region : mpcdi->regions) {
    const cv::Size size(region.width, region.height);
    LIMN_CHECK(!region.id.empty() && region.width > 0 && region.height > 0);
    LIMN_CHECK(region.warp.empty() || (region.warp.type() == CV_32FC3 && region.warp.cols <= region.width &&
                                       region.warp.rows <= region.height));
    for (const auto* map : {&region.alpha, &region.beta})
      LIMN_CHECK(!*map || ((*map)->image.size() == size && (*map)->gamma_embedded > 0));
    if (const auto imager = exchange::imager_of(region)) test::check_imager(*imager);
  }
}

std::string packed(const std::string& text) {
  constexpr const char* k_line = "\n%%\n";
  std::vector<exchange::ZipFile> files;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(k_line, at), text.size());
    const std::string name = files.empty() ? "mpcdi.xml" : std::to_string(files.size());
    files.push_back({name, text.substr(at, end - at), true});
    at = end + 4;
  }
  return exchange::zipped(files).value();
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(bytes), size);
  check(text);
  if (!text.starts_with("PK")) check(packed(text));
  return 0;
}
