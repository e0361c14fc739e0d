#include "nodes/file_listing.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <string_view>

#include "nodes/sha256.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t k_max_path = 1024, k_max_name = 255;  // bytes

// What is wrong with a path; empty: nothing.
std::string_view path_problem(std::string_view path) {
  if (path.empty()) return "an empty path";
  if (path.size() > k_max_path) return "a path of over 1024 bytes";
  if (path.front() == '/') return "an absolute path";
  const auto is_forbidden = [](char c) { return c == '\\' || std::iscntrl(static_cast<unsigned char>(c)); };
  if (std::any_of(path.begin(), path.end(), is_forbidden)) return "a backslash or a control character in it";
  while (!path.empty()) {
    const std::size_t end = std::min(path.find('/'), path.size());
    const std::string_view name = path.substr(0, end);
    if (name == "..") return "a path that leaves the folder";
    if (name.empty() || name == "." || end + 1 == path.size()) return "an empty name in the path";
    if (name.size() > k_max_name) return "a name of over 255 bytes in the path";
    path.remove_prefix(std::min(end + 1, path.size()));
  }
  return "";
}

// A path for a message, without what could disturb a terminal.
std::string printable_path(std::string_view path) {
  constexpr std::size_t k_most = 80;
  std::string text(path.substr(0, k_most));
  for (char& c : text)
    if (std::iscntrl(static_cast<unsigned char>(c))) c = '?';
  return text.size() < path.size() ? text + "..." : text;
}

Error path_refusal(std::string_view path, std::string_view found) {
  return error("the session's file '{}': expected a relative path inside the session's folder, found {}.",
               printable_path(path), found);
}

Status check_paths(const std::vector<SharedFile>& files) {
  if (files.size() > k_max_files)
    return error("expected at most {} files in a session, found {}. Remove those that it does not need.",
                 k_max_files, files.size());
  std::uint64_t bytes = 0;
  std::set<std::string_view> paths;
  for (const SharedFile& file : files) {
    if (const std::string_view problem = path_problem(file.path); !problem.empty())
      return path_refusal(file.path, problem);
    if (!paths.insert(file.path).second) return path_refusal(file.path, "it twice");
    if (file.bytes > k_max_bytes - bytes)
      return error(
          "expected at most {} GB of files in a session, found more. Use smaller textures or meshes.",
          k_max_bytes >> 30);
    bytes += file.bytes;
  }
  for (const SharedFile& file : files)
    for (std::size_t at = file.path.find('/'); at != std::string::npos; at = file.path.find('/', at + 1))
      if (paths.contains(std::string_view(file.path).substr(0, at)))
        return path_refusal(file.path, "that a folder on its way is a file");
  return {};
}

bool is_path_inside(const fs::path& path, const fs::path& folder) {
  const auto [at, rest] = std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
  return at == folder.end() && rest != path.end();
}

// Checks a folder's entry; `root` has no links in it. False: it is a folder.
Result<bool> is_file(const fs::directory_entry& entry, const fs::path& root) {
  std::error_code problem;
  const bool is_link = entry.is_symlink(problem), is_folder = entry.is_directory(problem);
  if (is_link && (is_folder || !is_path_inside(fs::weakly_canonical(entry.path(), problem), root)))
    return error(
        "{}: expected a file inside the session's folder, found a link to a folder or to a file elsewhere. "
        "Replace the link by what it leads to.",
        entry.path().string());
  if (is_folder) return false;
  if (entry.is_regular_file(problem)) return true;
  return error("{}: expected a file or a folder, found something else. Remove it.", entry.path().string());
}

}  // namespace

std::uint64_t piece_count(std::uint64_t file_bytes) {
  return (file_bytes + k_piece_bytes - 1) / k_piece_bytes;
}

std::size_t piece_size(std::uint64_t file_bytes, std::uint64_t piece) {
  return static_cast<std::size_t>(std::min<std::uint64_t>(k_piece_bytes, file_bytes - piece * k_piece_bytes));
}

Status check_listing(const std::vector<SharedFile>& files) {
  LIMN_TRY_STATUS(check_paths(files));
  for (const SharedFile& file : files)
    if (!is_sha256(file.sha256))
      return error("the session's file '{}': expected a SHA-256 of 64 hexadecimal digits, found '{}'.",
                   printable_path(file.path), printable_path(file.sha256));
  return {};
}

Result<std::vector<SharedFile>> list_files(const fs::path& folder) {
  std::error_code problem;
  const fs::path root = fs::canonical(folder, problem);
  std::vector<SharedFile> files;
  fs::recursive_directory_iterator at(folder, problem);
  for (; !problem && at != fs::recursive_directory_iterator(); at.increment(problem)) {
    LIMN_TRY(const bool is_listed, is_file(*at, root));
    if (!is_listed) continue;
    std::error_code gone;
    const std::uint64_t bytes = at->file_size(gone);
    if (!gone) files.push_back({at->path().lexically_relative(folder).generic_string(), "", bytes});
    if (files.size() > k_max_files) break;  // the message is that of check_paths()
  }
  if (problem)
    return error("{}: expected a folder that can be read, found: {}.", folder.string(), problem.message());
  std::sort(files.begin(), files.end(),
            [](const SharedFile& a, const SharedFile& b) { return a.path < b.path; });
  LIMN_TRY_STATUS(check_paths(files));
  return files;
}

}  // namespace limn::nodes
