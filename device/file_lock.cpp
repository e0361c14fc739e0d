#include "device/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include "core/file.h"

namespace limn::device {
namespace {

std::string holder_of(int descriptor) {
  std::array<char, 32> text{};
  const ssize_t size = pread(descriptor, text.data(), text.size(), 0);
  std::string number(text.data(), size > 0 ? static_cast<std::size_t>(size) : 0);
  while (!number.empty() && number.back() == '\n') number.pop_back();
  return number.empty() ? "another process" : "process " + number;
}

}  // namespace

Result<FileLock> FileLock::acquire(const std::filesystem::path& file, const std::string& what) {
  LIMN_TRY_STATUS(make_folder(file.parent_path()));
  const int descriptor = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (descriptor < 0)
    return error("{}: expected to write this file, found: {}.", file.string(),
                 std::generic_category().message(errno));
  FileLock lock(descriptor);
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno != EWOULDBLOCK)
    return error("{}: expected a file system with locks, found: {}.", file.string(),
                 std::generic_category().message(errno));
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0)
    return error(
        "{}: expected to use it alone, found that {} uses it. Stop that one first (kill, or, where it "
        "is a service, systemctl --user stop limn-live).",
        what, holder_of(descriptor));
  const std::string own = std::to_string(getpid()) + "\n";
  if (ftruncate(descriptor, 0) != 0 ||
      pwrite(descriptor, own.data(), own.size(), 0) != static_cast<ssize_t>(own.size()))
    return error("{}: expected to write {} bytes, found: {}.", file.string(), own.size(),
                 std::generic_category().message(errno));
  return lock;
}

FileLock::FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

FileLock& FileLock::operator=(FileLock&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace limn::device
