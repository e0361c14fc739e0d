#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// What somebody wrote about a part, a look, or the whole.
struct Comment {
  std::string at;  ///< UTC, "2026-01-31T12:00:00Z"
  std::string who;
  std::string look;  ///< empty: none in particular
  std::string slot;  ///< likewise
  std::string text;
};

/// Bounds of what is kept: bytes of a text, of the names in it, and comments of a project.
constexpr std::size_t k_longest_comment = 2000, k_longest_name = 64, k_most_comments = 1000;

/// A comment at this moment. Error: no text, or longer than the bounds, or not UTF-8 without control
/// characters but line feeds.
Result<Comment> make_comment(const std::string& who,
                             const std::string& look,
                             const std::string& slot,
                             const std::string& text);

/// limn.comments/1, the oldest first. A file that is not there holds none; one that is damaged is an error.
Result<std::vector<Comment>> load_comments(const std::filesystem::path& path);
/// Through a temporary file.
Status save_comments(const std::filesystem::path& path, const std::vector<Comment>& comments);

}  // namespace limn::scene
