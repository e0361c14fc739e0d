#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

namespace limn::nodes {

/// A file that is read or written in pieces, without a buffer. After a failure errno says why.
class OpenFile {
 public:
  /// Opens a file; is_open() says whether it worked. A last part of the path that is a link is not followed
  /// if `follows_links` is false.
  static OpenFile reading(const std::filesystem::path& path, bool follows_links = true);
  /// Makes a file or empties it.
  static OpenFile writing(const std::filesystem::path& path);
  /// Makes a file of a new name: `path` and a random ending.
  static OpenFile with_new_name(const std::filesystem::path& path);
  OpenFile(OpenFile&& other) noexcept;
  OpenFile& operator=(OpenFile&&) = delete;
  ~OpenFile();

  bool is_open() const { return handle_ >= 0; }
  const std::filesystem::path& path() const { return path_; }
  /// Reads up to `count` bytes at `offset` into `bytes`, fewer at the end of the file.
  bool read(std::uint64_t offset, std::size_t count, std::string* bytes);
  bool write(std::string_view bytes);
  /// False: what was written before is not on the disk.
  bool close();

 private:
  OpenFile(int handle, std::filesystem::path path) : handle_(handle), path_(std::move(path)) {}
  int handle_ = -1;
  std::filesystem::path path_;
};

}  // namespace limn::nodes
