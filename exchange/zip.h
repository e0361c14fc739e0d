#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"

namespace limn::apps {

/// A zip archive in memory.
class ZipArchive {
 public:
  /// Error, with `where` before it: a truncated or damaged archive, or none.
  static Result<ZipArchive> open(std::string bytes, const std::string& where);

  /// In the archive's order.
  std::vector<std::string> names() const;
  /// A file's content. Error, whose message does not say where: absent, damaged, encrypted, or more than
  /// `most_bytes` when unpacked, whatever the archive says.
  Result<std::string> read(const std::string& name, std::size_t most_bytes) const;

 private:
  struct Impl;
  explicit ZipArchive(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<const Impl> impl_;
};

struct ZipFile {
  std::string name;
  std::string content;
  bool is_packed = false;  ///< its bytes have been compressed already
};

/// The bytes of an archive of these files.
Result<std::string> zipped(const std::vector<ZipFile>& files);

}  // namespace limn::apps
