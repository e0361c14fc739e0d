#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::calib {

/// A folder among the system's temporary files. It is removed, with what it contains, with this object.
class TemporaryFolder {
 public:
  /// Error: the folder cannot be made (a full or read-only disk).
  static Result<TemporaryFolder> create();
  TemporaryFolder(TemporaryFolder&& other) noexcept;
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(TemporaryFolder&&) = delete;
  ~TemporaryFolder();

  const std::filesystem::path& path() const { return path_; }

 private:
  explicit TemporaryFolder(std::filesystem::path path) : path_(std::move(path)) {}
  std::filesystem::path path_;  ///< empty after a move
};

}  // namespace limn::calib
