#include "core/append_log.h"

#include <utility>

#include "core/file.h"

namespace limn {
namespace {

constexpr double k_every_s = 1;
constexpr std::size_t k_most_waiting = 1 << 20;

}  // namespace

Result<AppendLog> AppendLog::create(const std::filesystem::path& path, std::string_view first_line) {
  LIMN_TRY_STATUS(write_file(path, first_line));
  AppendLog out;
  out.path_ = path;
  return out;
}

AppendLog::AppendLog(AppendLog&& other) noexcept { *this = std::move(other); }

AppendLog& AppendLog::operator=(AppendLog&& other) noexcept {
  if (this == &other) return *this;
  flush();
  path_ = std::exchange(other.path_, {});
  waiting_ = std::exchange(other.waiting_, {});
  written_at_ = other.written_at_;
  is_stuck_ = other.is_stuck_;
  is_reported_ = other.is_reported_;
  why_ = std::move(other.why_);
  return *this;
}

AppendLog::~AppendLog() { flush(); }

void AppendLog::add(std::string_view line, Stamp at) {
  if (!is_open()) return;
  waiting_ += line;
  if (written_at_ && seconds_between(*written_at_, at) < k_every_s) return;
  written_at_ = at;
  flush();
}

void AppendLog::flush() {
  if (!is_open() || waiting_.empty()) return;
  const Status written = append_file(path_, waiting_);
  if (written) {
    waiting_.clear();
  } else if (waiting_.size() > k_most_waiting) {
    const std::size_t line_end = waiting_.find('\n', waiting_.size() - k_most_waiting);
    waiting_.erase(0, line_end + 1);
  }
  if (is_stuck_ == !written) return;
  is_stuck_ = !written;
  why_ = is_stuck_ ? written.message() : "";
  is_reported_ = false;
}

std::optional<std::string> AppendLog::take_message() {
  if (std::exchange(is_reported_, true)) return std::nullopt;
  if (!is_stuck_) return path_.filename().string() + " can be written again.";
  return why_ + " Its lines are kept and written later.";
}

}  // namespace limn
