#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "core/result.h"

namespace limn::remote {

/// The largest file of the page, bytes.
constexpr std::size_t k_longest_file = 2 * 1024 * 1024;

/// The page: all files of a folder that a browser may have, read once. What is asked for is looked up in
/// this list and nowhere else.
class StaticFiles {
 public:
  struct File {
    std::string type;  ///< MIME
    std::string tag;   ///< of the content: an ETag
    std::string content;
  };
  /// Regular files with a known ending, without hidden ones and links, in the folder and those inside. Error:
  /// no index.html there, a file that is too large or cannot be read.
  static Result<StaticFiles> read(const std::filesystem::path& folder);

  /// By the path of a request ("/", "/remote.css"); null: no such file. "/" is index.html, "/NAME" may stand
  /// for NAME.html.
  const File* find(const std::string& path) const;

 private:
  std::map<std::string, File> files_;
};

}  // namespace limn::remote
