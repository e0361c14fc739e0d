#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

namespace limn::scene {

/// The text of a .glb's JSON; empty when it has none, or when the file was cut, as by a full disk
/// or a copy that ended.
inline std::string glb_header(const std::filesystem::path& glb) {
  std::ifstream in(glb, std::ios::binary);
  std::array<std::uint32_t, 5> head{};  // magic, version, length; the first chunk's length and type
  if (!in.read(reinterpret_cast<char*>(head.data()), sizeof(head))) return {};
  std::error_code none;
  const std::uintmax_t size = std::filesystem::file_size(glb, none);
  if (std::memcmp(head.data(), "glTF", 4) != 0 || head[2] != size || head[3] > size) return {};
  std::string text(head[3], ' ');
  if (!in.read(text.data(), static_cast<std::streamsize>(text.size()))) return {};
  return text;
}

}  // namespace limn::scene
