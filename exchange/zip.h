#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"

namespace limn::exchange {

/// A zip archive in memory.
class ZipArchive {
 public:
  /// Error, which begins with `where`: no archive, or a truncated or damaged one.
  static Result<ZipArchive> open(std::string bytes, const std::string& where);

  /// The files' names in the archive's order.
  std::vector<std::string> names() const;
  /// The content of a file. The error does not name the archive: the file is absent, damaged, encrypted, or
  /// larger than `most_bytes` when unpacked, whatever size the archive states.
  Result<std::string> read(const std::string& name, std::size_t most_bytes) const;

 private:
  struct Impl;
  explicit ZipArchive(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<const Impl> impl_;
};

struct ZipFile {
  std::string name;
  std::string content;
  bool is_packed = false;  ///< The content is compressed already.
};

/// The bytes of an archive with these files.
Result<std::string> zipped(const std::vector<ZipFile>& files);

}  // namespace limn::exchange
