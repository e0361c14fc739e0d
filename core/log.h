#pragma once

#include <fmt/format.h>

#include <string>

namespace limn {

enum class LogLevel { quiet, warning, info };

/// What reaches stderr; info unless set.
void set_log_level(LogLevel level);
/// One line on stderr, safe from several threads. stdout is for results alone.
void log_line(LogLevel level, const std::string& line);

template <class... Args>
void log_info(fmt::format_string<Args...> format, Args&&... args) {
  log_line(LogLevel::info, fmt::format(format, std::forward<Args>(args)...));
}
template <class... Args>
void log_warning(fmt::format_string<Args...> format, Args&&... args) {
  log_line(LogLevel::warning, fmt::format(format, std::forward<Args>(args)...));
}

/// Progress of long work on stderr: "capture 37/704 (12 s)". Redraws one line on a terminal, prints a line
/// every few seconds elsewhere; silent for work under a second.
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
