// Answers of HTTP servers that send a stream of JPEGs. The first byte says in which pieces they come.
#include <algorithm>

#include "device/mjpeg_stream.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  if (size == 0) return 0;
  const std::string_view text(reinterpret_cast<const char*>(bytes) + 1, size - 1);
  const std::size_t piece = 1 + bytes[0];
  device::MjpegStream stream(1 << 16);
  for (std::size_t at = 0; at < text.size(); at += piece) {
    const Status fed = stream.feed(text.substr(at, piece), {});
    if (!fed) {
      LIMN_CHECK(!fed.message().empty());
      return 0;
    }
    if (const auto part = stream.take_newest()) LIMN_CHECK(part->jpeg.size() <= size);
  }
  return 0;
}
