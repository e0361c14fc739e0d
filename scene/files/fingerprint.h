#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace limn::scene {

/// The fingerprint of content that comes in pieces.
class Fingerprint {
 public:
  void add(std::string_view content) {
    for (const char c : content) hash_ = (hash_ ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  }
  std::string text() const {
    std::string text(16, '0');
    std::uint64_t hash = hash_;
    for (std::size_t i = 16; i-- > 0; hash >>= 4) text[i] = "0123456789abcdef"[hash & 15U];
    return text;
  }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325U;
};

/// A short text that differs for different contents (FNV-1a, 64 bits), to notice that a file has changed. It
/// protects against no one.
inline std::string fingerprint(std::string_view content) {
  Fingerprint print;
  print.add(content);
  return print.text();
}

}  // namespace limn::scene
