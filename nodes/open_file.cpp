#include "nodes/open_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>

namespace limn::nodes {

namespace fs = std::filesystem;

OpenFile OpenFile::reading(const fs::path& path, bool follows_links) {
  // A pipe in the place of a file must not block.
  const int flags = O_RDONLY | O_CLOEXEC | O_NONBLOCK | (follows_links ? 0 : O_NOFOLLOW);
  return {::open(path.c_str(), flags), path};
}

OpenFile OpenFile::writing(const fs::path& path) {
  return {::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644), path};
}

OpenFile OpenFile::with_new_name(const fs::path& path) {
  std::string name = path.string() + ".XXXXXX";
  const int handle = ::mkostemp(name.data(), O_CLOEXEC);
  return {handle, name};
}

OpenFile::OpenFile(OpenFile&& other) noexcept
    : handle_(std::exchange(other.handle_, -1)), path_(std::move(other.path_)) {}

OpenFile::~OpenFile() { close(); }

bool OpenFile::read(std::uint64_t offset, std::size_t count, std::string* bytes) {
  bytes->resize(count);
  for (std::size_t done = 0; done < count;) {
    const ssize_t got =
        ::pread(handle_, bytes->data() + done, count - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return false;
    if (got == 0) bytes->resize(done);
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return true;
}

bool OpenFile::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(handle_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

bool OpenFile::close() {
  const int handle = std::exchange(handle_, -1);
  return handle < 0 || ::close(handle) == 0;
}

}  // namespace limn::nodes
