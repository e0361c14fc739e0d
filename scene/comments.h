#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// What somebody wrote about a part, a look, or the whole project.
struct Comment {
  std::string at;  ///< UTC, "2026-01-31T12:00:00Z"
  std::string who;
  std::string look;  ///< The look that it is about; empty: none in particular.
  std::string slot;  ///< The slot that it is about; empty: none in particular.
  std::string text;
};

/// Limits: bytes of a comment's text, bytes of each name in it, and comments in a project.
constexpr std::size_t k_longest_comment = 2000, k_longest_name = 64, k_most_comments = 1000;

/// A comment with the current time. Error: empty text, text or names longer than the limits, text that is not
/// UTF-8, or control characters other than line feeds.
Result<Comment> make_comment(const std::string& who,
                             const std::string& look,
                             const std::string& slot,
                             const std::string& text);

/// Reads a limn.comments/1 file, the oldest comment first. A missing file means no comments; a damaged one is
/// an error.
Result<std::vector<Comment>> load_comments(const std::filesystem::path& path);
/// Writes a limn.comments/1 file. When writing fails, `path` keeps its old content.
Status save_comments(const std::filesystem::path& path, const std::vector<Comment>& comments);

}  // namespace limn::scene
