#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

namespace limn::scene {

/// The JSON of a .glb without its buffers; null when it has none, or when the file was cut, as by a full disk
/// or a copy that ended.
inline nlohmann::json glb_header(const std::filesystem::path& glb) {
  std::ifstream in(glb, std::ios::binary);
  std::array<std::uint32_t, 5> head{};  // magic, version, length; the first chunk's length and type
  if (!in.read(reinterpret_cast<char*>(head.data()), sizeof(head))) return {};
  std::error_code none;
  const std::uintmax_t size = std::filesystem::file_size(glb, none);
  if (std::memcmp(head.data(), "glTF", 4) != 0 || head[2] != size || head[3] > size) return {};
  std::string text(head[3], ' ');
  if (!in.read(text.data(), static_cast<std::streamsize>(text.size()))) return {};
  return nlohmann::json::parse(text, nullptr, false);
}

}  // namespace limn::scene
