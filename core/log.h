#pragma once

#include <fmt/format.h>

#include <string>

namespace limn {

enum class LogLevel { quiet, warning, info };

/// Sets which messages are printed to stderr; the default is info.
void set_log_level(LogLevel level);
/// Prints one line to stderr; several threads may call it. stdout is only for results.
void log_line(LogLevel level, const std::string& line);

template <class... Args>
void log_info(fmt::format_string<Args...> format, Args&&... args) {
  log_line(LogLevel::info, fmt::format(format, std::forward<Args>(args)...));
}
template <class... Args>
void log_warning(fmt::format_string<Args...> format, Args&&... args) {
  log_line(LogLevel::warning, fmt::format(format, std::forward<Args>(args)...));
}

/// Shows the progress of long work on stderr: "capture 37/704 (12 s)". On a terminal one line is redrawn;
/// otherwise a line is printed every few seconds. Work of less than a second shows nothing.
class Progress {
 public:
  Progress(std::string what, int total);
  ~Progress();
  void step(int done);

 private:
  std::string what_;
  int total_;
  int done_ = 0;
  double started_s_;
  double printed_s_;
};

}  // namespace limn
