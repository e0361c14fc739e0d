#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace limn::scene {

/// A short text that differs for different contents (FNV-1a, 64 bits), to notice that a file has changed. It
/// protects against no one.
inline std::string fingerprint(std::string_view content) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char c : content) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  std::string text(16, '0');
  for (std::size_t i = 16; i-- > 0; hash >>= 4) text[i] = "0123456789abcdef"[hash & 15U];
  return text;
}

}  // namespace limn::scene
