#include "validate/hardware_report/image_metadata.h"

#include <cstdint>
#include <string_view>
#include <utility>

namespace limn::validate {
namespace {

std::uint8_t byte_at(std::string_view bytes, std::size_t at) { return static_cast<std::uint8_t>(bytes[at]); }

// What a segment holds: JFIF (APP0) and Adobe's colours (APP14) are needed for the pixels.
bool is_metadata(std::uint8_t marker) {
  constexpr std::uint8_t k_comment = 0xFE, k_app0 = 0xE0, k_app14 = 0xEE, k_app15 = 0xEF;
  return marker == k_comment || (marker > k_app0 && marker <= k_app15 && marker != k_app14);
}

// Where pixels end that begin at `at`: at the next marker. FF 00 is a byte FF of theirs, FF D0 to FF D7 are
// in their middle, and several FF may stand before a marker.
std::size_t pixels_end(std::string_view jpeg, std::size_t at) {
  for (; at + 1 < jpeg.size(); ++at) {
    const std::uint8_t next = byte_at(jpeg, at + 1);
    if (byte_at(jpeg, at) == 0xFF && next != 0 && next != 0xFF && (next < 0xD0 || next > 0xD7)) return at;
  }
  return jpeg.size();
}

// Segments are FF, marker, length (2 bytes, with themselves), content; pixels follow the segment SOS, perhaps
// several times. What follows the end of the image (EOI) goes, too.
Result<std::optional<std::string>> jpeg_without(std::string_view jpeg) {
  constexpr std::uint8_t k_pixels = 0xDA, k_end = 0xD9;
  std::string out(jpeg.substr(0, 2));
  bool is_changed = false;
  for (std::size_t at = 2; at + 2 <= jpeg.size();) {
    if (byte_at(jpeg, at) != 0xFF) break;
    const std::uint8_t marker = byte_at(jpeg, at + 1);
    if (marker == 0xFF) {  // a fill byte
      ++at;
      continue;
    }
    if (marker == k_end) {
      out += jpeg.substr(at, 2);
      is_changed = is_changed || at + 2 < jpeg.size();
      return is_changed ? std::optional(std::move(out)) : std::nullopt;
    }
    if (at + 4 > jpeg.size()) break;
    const std::size_t length = 2 + 256U * byte_at(jpeg, at + 2) + byte_at(jpeg, at + 3);
    if (length < 4 || at + length > jpeg.size()) break;
    const std::size_t end = marker == k_pixels ? pixels_end(jpeg, at + length) : at + length;
    if (is_metadata(marker))
      is_changed = true;
    else
      out += jpeg.substr(at, end - at);
    at = end;
  }
  return error("expected a JPEG image, found other or damaged bytes.");
}

}  // namespace

Result<std::optional<std::string>> without_metadata(const std::string& jpeg) {
  if (!jpeg.starts_with("\xFF\xD8")) return error("expected a JPEG image, found another file.");
  return jpeg_without(jpeg);
}

}  // namespace limn::validate
