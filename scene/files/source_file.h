#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/result.h"
#include "scene/files/fingerprint.h"

namespace limn::scene {

/// Which limn-cad made a kept GLB: it grows whenever the same CAD file becomes another GLB.
inline constexpr int k_cad_glb_format = 4;

/// Error: the path is no regular file (after links): there is none, or it is a folder, a pipe or a device.
inline Status check_regular_file(const std::filesystem::path& path) {
  std::error_code none;
  const auto found = std::filesystem::status(path, none);
  if (std::filesystem::is_regular_file(found)) return {};
  return error("{}: expected a file, found {}. Check its name.", path.string(),
               !std::filesystem::exists(found)        ? "no file"
               : std::filesystem::is_directory(found) ? "a folder"
                                                      : "a pipe or a device");
}

/// Whether a file name that a CAD file states stays below that file's folder, whichever slashes it has.
inline bool stays_inside(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  const std::filesystem::path path = name;
  if (path.empty() || path.is_absolute() || (name.size() > 1 && name[1] == ':')) return false;
  return std::find(path.begin(), path.end(), "..") == path.end();
}

/// The fingerprint of a file's content; empty when it is no regular file, cannot be read, or is larger than
/// 4 GB.
inline std::string file_fingerprint(const std::filesystem::path& path) {
  constexpr std::uintmax_t k_most = std::uintmax_t{4} << 30U;
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none) || std::filesystem::file_size(path, none) > k_most)
    return "";
  std::ifstream in(path, std::ios::binary);
  Fingerprint print;
  std::string piece(std::size_t{1} << 20U, '\0');
  while (in.read(piece.data(), static_cast<std::streamsize>(piece.size())) || in.gcount() > 0)
    print.add({piece.data(), static_cast<std::size_t>(in.gcount())});
  return in.eof() ? print.text() : "";
}

}  // namespace limn::scene
