#include "remote/http/static_files.h"

#include <openssl/evp.h>

#include <array>

#include "core/file.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, std::string>& types() {
  static const std::map<std::string, std::string> all = {
      {".html", "text/html; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".json", "application/json"},
      {".webmanifest", "application/manifest+json"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".jpg", "image/jpeg"},
      {".ico", "image/x-icon"},
      {".woff2", "font/woff2"},
      {".txt", "text/plain; charset=utf-8"},
  };
  return all;
}

std::string tag_of(const std::string& content) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  LIMN_CHECK(EVP_Digest(content.data(), content.size(), digest.data(), &length, EVP_sha256(), nullptr) == 1);
  std::string tag;
  for (std::size_t i = 0; i < 12; ++i) tag += fmt::format("{:02x}", digest[i]);
  return fmt::format("\"{}\"", tag);
}

}  // namespace

Result<StaticFiles> StaticFiles::read(const fs::path& folder) {
  StaticFiles out;
  std::error_code problem;
  for (auto at = fs::recursive_directory_iterator(folder, problem);
       !problem && at != fs::recursive_directory_iterator(); at.increment(problem)) {
    const bool is_hidden = at->path().filename().string().front() == '.';
    if (is_hidden && at->is_directory()) at.disable_recursion_pending();
    const auto type = types().find(at->path().extension().string());
    if (is_hidden || at->is_symlink() || !at->is_regular_file() || type == types().end()) continue;
    if (at->file_size() > k_longest_file)
      return error("{}: expected a file of at most {} bytes, found {}.", at->path().string(), k_longest_file,
                   at->file_size());
    LIMN_TRY(std::string content, read_file(at->path()));
    std::string tag = tag_of(content);
    const std::string path = fmt::format("/{}", fs::relative(at->path(), folder).generic_string());
    out.files_[path] = {type->second, std::move(tag), std::move(content)};
  }
  if (!out.files_.contains("/index.html"))
    return error("{}: expected the page's files (index.html and others), found none. Install Limn again.",
                 folder.string());
  return out;
}

const StaticFiles::File* StaticFiles::find(const std::string& path) const {
  const auto found = files_.find(path == "/" ? "/index.html" : path);
  if (found != files_.end()) return &found->second;
  const auto page = files_.find(path + ".html");
  return page == files_.end() ? nullptr : &page->second;
}

}  // namespace limn::remote
