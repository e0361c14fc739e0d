#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "core/frame.h"
#include "core/result.h"

namespace limn::apps {

/// A text file that grows line by line and is written about once a second. While it cannot be written (a full
/// disk) the lines wait and are written later; of more than a megabyte the oldest are lost.
class AppendLog {
 public:
  AppendLog() = default;  ///< no file: lines are forgotten
  /// A new file with its first line.
  static Result<AppendLog> create(const std::filesystem::path& path, std::string_view first_line);
  AppendLog(AppendLog&& other) noexcept;
  AppendLog& operator=(AppendLog&& other) noexcept;
  ~AppendLog();

  bool is_open() const { return !path_.empty(); }
  void add(std::string_view line, Stamp at);
  void flush();

  /// Once when lines begin to wait, and once when they are written again: a sentence that tells it.
  std::optional<std::string> news();

 private:
  std::filesystem::path path_;
  std::string waiting_;
  std::optional<Stamp> written_at_;
  bool is_stuck_ = false, is_told_ = true;
  std::string why_;
};

}  // namespace limn::apps
