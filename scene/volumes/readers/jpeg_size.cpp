#include "scene/volumes/readers/jpeg_size.h"

namespace limn::scene {

std::optional<std::array<long, 2>> jpeg_size(std::span<const std::uint8_t> head) {
  const auto word = [&](std::size_t at) { return static_cast<long>(head[at] << 8 | head[at + 1]); };
  if (head.size() < 2 || word(0) != 0xffd8) return std::nullopt;
  for (std::size_t at = 2; at + 10 <= head.size();) {
    if (head[at] != 0xff) return std::nullopt;
    const int marker = head[at + 1];
    if (marker == 0xff) {  // a byte that fills up
      ++at;
      continue;
    }
    const bool is_table = marker == 0xc4 || marker == 0xc8 || marker == 0xcc;
    if ((marker >= 0xc0 && marker <= 0xcf && !is_table) || marker == 0xf7) {
      if (head[at + 9] != 1) return std::nullopt;
      return std::array{word(at + 7), word(at + 5)};
    }
    if (marker < 0xc0 || (marker >= 0xd0 && marker <= 0xda)) return std::nullopt;
    at += 2 + static_cast<std::size_t>(word(at + 2));
  }
  return std::nullopt;
}

}  // namespace limn::scene
