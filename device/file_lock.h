#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::device {

/// A lock that one process at a time can hold. It ends with the process, however that ends.
class FileLock {
 public:
  /// Locks the file, which is made where it is missing and then holds this process's number. `what` says in
  /// the message what the lock protects. Error: another process holds it (the message names its number), or
  /// the file cannot be written.
  static Result<FileLock> acquire(const std::filesystem::path& file, const std::string& what);

  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&& other) noexcept;
  ~FileLock();

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace limn::device
