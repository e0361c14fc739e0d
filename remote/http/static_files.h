#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "core/result.h"

namespace limn::remote {

/// The largest file of the page, bytes.
constexpr std::size_t k_longest_file = 2 * 1024 * 1024;

/// The page's files, read into memory once. Requests are looked up in this list and never reach the disk.
class StaticFiles {
 public:
  struct File {
    std::string type;  ///< MIME type.
    std::string tag;   ///< ETag of the content.
    std::string content;
  };
  /// Reads the regular files of a folder and the folders inside that have a known ending, without hidden
  /// files and links. Errors: no index.html there, a file that is too large or cannot be read.
  static Result<StaticFiles> read(const std::filesystem::path& folder);

  /// The file at the path of a request ("/remote.css"); null: there is none. "/" is index.html, and "/NAME"
  /// is NAME.html if there is no file NAME.
  const File* find(const std::string& path) const;

 private:
  std::map<std::string, File> files_;
};

}  // namespace limn::remote
