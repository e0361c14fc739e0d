#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "core/frame.h"
#include "core/result.h"

namespace limn {

/// A text file to which lines are appended; it is written about once a second. While it cannot be written (a
/// full disk), the lines are kept in memory and written later; beyond one megabyte the oldest lines are
/// dropped.
class AppendLog {
 public:
  AppendLog() = default;  ///< Without a file: lines are discarded.
  /// Creates a file with this first line.
  static Result<AppendLog> create(const std::filesystem::path& path, std::string_view first_line);
  AppendLog(AppendLog&& other) noexcept;
  AppendLog& operator=(AppendLog&& other) noexcept;
  ~AppendLog();

  bool is_open() const { return !path_.empty(); }
  void add(std::string_view line, Stamp at);
  void flush();

  /// A message when writing begins to fail, and one when it works again, each once; otherwise nullopt.
  std::optional<std::string> take_message();

 private:
  std::filesystem::path path_;
  std::string waiting_;
  std::optional<Stamp> written_at_;
  bool is_stuck_ = false, is_reported_ = true;
  std::string why_;
};

}  // namespace limn
