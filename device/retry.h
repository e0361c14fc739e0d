#pragma once

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>

#include "core/frame.h"

namespace limn::device {

/// When a lost device is tried again: after 0.1 s, doubling to 2 s while it fails. Keeps why it failed.
class Retry {
 public:
  void note_failure(const std::string& why) {
    problem_ = why;
    due_ = shifted(std::chrono::steady_clock::now(), pause_s_);
    pause_s_ = std::min(2 * pause_s_, k_longest_pause_s);
  }
  void note_success() { pause_s_ = k_first_pause_s; }
  /// A fault that does not end the connection.
  void note(const std::string& problem) { problem_ = problem; }
  const std::string& problem() const { return problem_; }
  /// Sleeps until the next attempt is due; false when that lies behind `deadline`.
  bool wait(Stamp deadline) const {
    std::this_thread::sleep_until(std::min(due_, deadline));
    return std::chrono::steady_clock::now() < deadline;
  }

 private:
  static constexpr double k_first_pause_s = 0.1, k_longest_pause_s = 2;
  double pause_s_ = k_first_pause_s;
  Stamp due_ = std::chrono::steady_clock::now();
  std::string problem_ = "nothing has come yet.";
};

}  // namespace limn::device
