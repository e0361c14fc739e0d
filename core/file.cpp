#include "core/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <vector>

namespace limn {
namespace {

namespace fs = std::filesystem;

Error write_error(const fs::path& path, int code) {
  const char* advice = code == ENOSPC ? "Free some space, or choose another folder."
                       : code == EACCES || code == EROFS || code == EPERM
                           ? "Make the folder writable, or choose another one."
                           : "Check that the folder exists and can be written.";
  return error("{}: expected to write here, found: {}. {}", path.string(), std::strerror(code), advice);
}

// Writes all of `content` to an open file; returns 0 or errno.
int write_all(int fd, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = ::write(fd, content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    content.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

// Moves every file of `fresh` to `folder`, where no file is absent meanwhile; `old` gets links to what it
// replaces. If one cannot be moved, all are as before.
Status replace_files(const fs::path& fresh, const fs::path& folder, const fs::path& old) {
  std::vector<fs::path> names;
  for (const auto& entry : fs::directory_iterator(fresh)) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  int code = 0;
  std::size_t replaced = 0;
  for (; replaced < names.size() && code == 0; ++replaced) {
    const fs::path& name = names[replaced];
    const fs::path target = folder / name, backup = old / name;
    if (::link(target.c_str(), backup.c_str()) != 0 && errno != ENOENT) {
      code = errno;  // Some file systems have no links; a folder is not replaced.
      if (fs::is_regular_file(target) && ::rename(target.c_str(), backup.c_str()) == 0) code = 0;
    }
    if (code == 0 && ::rename((fresh / name).c_str(), target.c_str()) != 0) code = errno;
  }
  if (code == 0) return {};
  const fs::path problem = folder / names[replaced - 1];
  for (std::size_t i = 0; i < replaced; ++i) {
    if (i + 1 < replaced) ::unlink((folder / names[i]).c_str());
    if (fs::exists(old / names[i])) ::rename((old / names[i]).c_str(), (folder / names[i]).c_str());
  }
  return write_error(problem, code);
}

std::string with_all_replaced(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
    text.replace(at, what.size(), by);
  return text;
}

}  // namespace

Result<std::string> read_file(const fs::path& path) {
  if (std::error_code ignored; fs::is_directory(path, ignored))
    return error("{}: expected a file, found a folder.", path.string());
  std::ifstream in(path, std::ios::binary);
  if (!in)
    return error("{}: cannot read this file: {}. Check its name.", path.string(), std::strerror(errno));
  std::ostringstream content;
  content << in.rdbuf();
  if (in.bad()) return error("{}: reading stopped: {}.", path.string(), std::strerror(errno));
  return std::move(content).str();
}

Status write_file(const fs::path& path, std::string_view content) {
  std::string temporary = path.string() + ".XXXXXX";
  const int fd = ::mkstemp(temporary.data());
  if (fd < 0) return write_error(path, errno);
  ::fchmod(fd, 0644);
  int code = write_all(fd, content);
  if (::close(fd) != 0 && code == 0) code = errno;
  if (code == 0 && ::rename(temporary.c_str(), path.c_str()) != 0) code = errno;
  if (code != 0) {
    ::unlink(temporary.c_str());
    return write_error(path, code);
  }
  return {};
}

Status write_together(const fs::path& folder, const std::function<Status(const fs::path& into)>& write) {
  LIMN_TRY_STATUS(make_folder(folder));
  std::string name = (folder / ".new.XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) return write_error(folder, errno);
  const fs::path staging = name, fresh = staging / "new", old = staging / "old";
  std::error_code ignored;
  fs::create_directory(fresh, ignored);
  fs::create_directory(old, ignored);
  Status done = write(fresh);
  if (done)
    done = replace_files(fresh, folder, old);
  else
    done =
        Error{with_all_replaced(done.message(), fresh.string(), folder.string()), done.error().wrong_usage};
  fs::remove_all(staging, ignored);
  return done;
}

Status append_file(const fs::path& path, std::string_view content) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (fd < 0) return write_error(path, errno);
  const off_t before = ::lseek(fd, 0, SEEK_END);
  int code = write_all(fd, content);
  if (code != 0 && before >= 0 && ::ftruncate(fd, before) != 0) code = errno;
  if (::close(fd) != 0 && code == 0) code = errno;
  return code == 0 ? Status() : Status(write_error(path, code));
}

Status make_folder(const fs::path& path) {
  std::error_code problem;
  fs::create_directories(path, problem);
  if (problem) return write_error(path, problem.value());
  if (!fs::is_directory(path, problem)) return error("{}: expected a folder, found a file.", path.string());
  if (::access(path.c_str(), W_OK | X_OK) != 0) return write_error(path, errno);
  return {};
}

}  // namespace limn
