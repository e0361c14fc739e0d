#include "core/log.h"

#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <utility>

#include "core/log_error.h"
#include "core/log_sink.h"

namespace limn {
namespace {

std::atomic<LogLevel> g_level{LogLevel::info};
std::mutex g_stderr, g_sink_mutex;
std::shared_ptr<const LogSink> g_sink;

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

constexpr double k_silent_s = 1;  // shorter work shows no progress (docs/formats.md)
constexpr double k_terminal_every_s = 0.1;
constexpr double k_file_every_s = 5;

// Whether stderr goes to systemd's journal: JOURNAL_STREAM names its device and inode.
bool is_journal() {
  const char* const named = std::getenv("JOURNAL_STREAM");
  struct stat found {};
  return named && fstat(STDERR_FILENO, &found) == 0 &&
         fmt::format("{}:{}", found.st_dev, found.st_ino) == named;
}

// The journal reads a line's level from its start (sd-daemon(3)); people get no prefix.
std::string journal_prefix(int level) {
  static const bool is_needed = is_journal();
  return is_needed ? fmt::format("<{}>", level) : "";
}
constexpr int k_journal_error = 3, k_journal_warning = 4, k_journal_info = 6;

// A line that cannot be written (full disk, closed pipe) is lost, because there is no other way to report it.
void write_line(const std::string& text) {
  const std::lock_guard lock(g_stderr);
  std::fwrite(text.data(), 1, text.size(), stderr);
}

std::shared_ptr<const LogSink> current_sink() {
  const std::lock_guard lock(g_sink_mutex);
  return g_sink;
}

// Gives the line to the sink; false if there is none. No lock is held while the sink runs: it may wait for
// another thread that logs.
bool is_taken_by_sink(LogLevel level, const std::string& line) {
  const auto sink = current_sink();
  if (sink) (*sink)(level, line);
  return sink != nullptr;
}

}  // namespace

void set_log_level(LogLevel level) { g_level = level; }

void set_log_sink(LogSink sink) {
  auto next = sink ? std::make_shared<const LogSink>(std::move(sink)) : nullptr;
  const std::lock_guard lock(g_sink_mutex);
  g_sink.swap(next);  // so that the old one is destroyed after the lock
}

void log_line(LogLevel level, const std::string& line) {
  if (level > g_level.load() || is_taken_by_sink(level, line)) return;
  write_line(journal_prefix(level == LogLevel::warning ? k_journal_warning : k_journal_info) + line + "\n");
}

void log_error_line(const std::string& line) {
  if (g_level.load() == LogLevel::quiet || is_taken_by_sink(LogLevel::warning, line)) return;
  write_line(journal_prefix(k_journal_error) + line + "\n");
}

Progress::Progress(std::string what, int total)
    : what_(std::move(what)), total_(total), started_s_(now_s()), printed_s_(0) {}

void Progress::step(int done) {
  done_ = done;
  const double now = now_s();
  const bool terminal = isatty(STDERR_FILENO) != 0;
  const double every = terminal ? k_terminal_every_s : k_file_every_s;
  if (g_level.load() < LogLevel::info || now - started_s_ < k_silent_s || now - printed_s_ < every ||
      current_sink())
    return;
  printed_s_ = now;
  write_line(fmt::format("{}{} {}/{} ({:.0f} s){}",
                         terminal ? std::string("\r\033[K") : journal_prefix(k_journal_info), what_, done_,
                         total_, now - started_s_, terminal ? "" : "\n"));
}

Progress::~Progress() {
  const double seconds = now_s() - started_s_;
  if (g_level.load() < LogLevel::info || seconds < k_silent_s || current_sink()) return;
  write_line(fmt::format("{}{} {}/{} ({:.1f} s)\n",
                         isatty(STDERR_FILENO) ? std::string("\r\033[K") : journal_prefix(k_journal_info),
                         what_, done_, total_, seconds));
}

}  // namespace limn
