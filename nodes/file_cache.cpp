#include "nodes/file_cache.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <vector>

#include "core/file.h"
#include "nodes/open_file.h"
#include "nodes/sha256.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t k_copied_bytes = 1 << 20;  // at once
constexpr std::size_t k_hash_digits = 64;

Error write_problem(const fs::path& path, const std::string& advice) {
  const int code = errno;
  return error("{}: expected room for the session's files, found: {}. {}", path.parent_path().string(),
               std::strerror(code),
               code == ENOSPC || code == EDQUOT || code == EFBIG ? advice : "Make the folder writable.");
}

Error cache_problem(const fs::path& path) {
  return write_problem(
      path,
      "Free some space there (this folder may be emptied), or set XDG_CACHE_HOME to a folder "
      "on a larger disk.");
}

void remove_file(const fs::path& path) {
  std::error_code ignored;
  fs::remove(path, ignored);
}

// Copies what `in` has, at most one piece more than it should have. True: it is what it should be.
Result<bool> copy_checked(const SharedFile& file, OpenFile* in, OpenFile* out) {
  Sha256 hash;
  std::string bytes;
  std::uint64_t done = 0;
  do {
    if (!in->read(done, k_copied_bytes, &bytes)) return false;
    hash.add(bytes);
    if (!out->write(bytes)) return write_problem(out->path(), "Free some space there.");
    done += bytes.size();
  } while (!bytes.empty() && done <= file.bytes);
  if (!out->close()) return write_problem(out->path(), "Free some space there.");
  return done == file.bytes && hash.digest() == file.sha256;
}

struct CachedFile {
  fs::path path;
  std::string sha256;
  std::uint64_t bytes = 0;
  fs::file_time_type used_at;
};

// Also those that are being written, whose names have an ending.
std::vector<CachedFile> cached_files(const fs::path& folder) {
  std::vector<CachedFile> out;
  std::error_code problem;
  fs::directory_iterator at(folder, problem);
  for (; !problem && at != fs::directory_iterator(); at.increment(problem)) {
    CachedFile file{at->path(), at->path().filename().string().substr(0, k_hash_digits), 0, {}};
    std::error_code gone;
    file.bytes = at->file_size(gone);
    if (!gone) file.used_at = at->last_write_time(gone);
    if (!gone && is_sha256(file.sha256)) out.push_back(std::move(file));
  }
  return out;
}

}  // namespace

Result<bool> FileCache::copy_file(const SharedFile& file, const fs::path& to) const {
  const fs::path from = folder_ / file.sha256;
  OpenFile in = OpenFile::reading(from, false);
  if (!in.is_open()) return false;
  OpenFile out = OpenFile::writing(to);
  if (!out.is_open()) return write_problem(to, "Free some space there.");
  // It is checked again: nothing makes sure that the bytes were on the disk when the power failed.
  LIMN_TRY(const bool is_good, copy_checked(file, &in, &out));
  std::error_code ignored;
  if (is_good) {
    fs::last_write_time(from, fs::file_time_type::clock::now(), ignored);
  } else {
    remove_file(from);
    remove_file(to);
  }
  return is_good;
}

Status FileCache::add_file(const SharedFile& file,
                           const std::function<Status(const WriteBytes&)>& fill) const {
  LIMN_TRY_STATUS(make_folder(folder_));
  OpenFile out = OpenFile::with_new_name(folder_ / file.sha256);
  if (!out.is_open()) return cache_problem(folder_ / file.sha256);
  Sha256 hash;
  std::uint64_t done = 0;
  Status status = fill([&](std::string_view bytes) {
    hash.add(bytes);
    done += bytes.size();
    return out.write(bytes) ? Status() : Status(cache_problem(out.path()));
  });
  if (!out.close() && status) status = cache_problem(out.path());
  if (status && (done != file.bytes || hash.digest() != file.sha256))
    status = error(
        "the session's file {}: expected the {} bytes that the host announced, found others ({} bytes). "
        "Check "
        "the network and the host's disk.",
        file.path, file.bytes, done);
  if (status && ::rename(out.path().c_str(), (folder_ / file.sha256).c_str()) != 0)
    status = cache_problem(out.path());
  if (!status) remove_file(out.path());
  return status;
}

void FileCache::remove_oldest(const std::set<std::string>& needed) const {
  std::vector<CachedFile> files = cached_files(folder_);
  std::sort(files.begin(), files.end(),
            [](const CachedFile& a, const CachedFile& b) { return a.used_at < b.used_at; });
  std::uint64_t bytes = 0;
  for (const CachedFile& file : files) bytes += file.bytes;
  for (const CachedFile& file : files) {
    if (bytes <= most_bytes_) return;
    if (needed.contains(file.sha256)) continue;
    remove_file(file.path);
    bytes -= file.bytes;
  }
}

}  // namespace limn::nodes
