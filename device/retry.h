#pragma once

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>

#include "core/frame.h"

namespace limn::device {

/// Determines when a lost device is tried again: after 0.1 s, then at intervals that double up to 2 s. It
/// also stores the last reason of failure.
class Retry {
 public:
  void note_failure(const std::string& why) {
    problem_ = why;
    due_ = shifted(std::chrono::steady_clock::now(), pause_s_);
    pause_s_ = std::min(2 * pause_s_, k_longest_pause_s);
  }
  void note_success() { pause_s_ = k_first_pause_s; }
  /// Stores a fault that does not end the connection.
  void note(const std::string& problem) { problem_ = problem; }
  const std::string& problem() const { return problem_; }
  /// Sleeps until the next attempt is due, at most until `deadline`; false when `deadline` has passed.
  bool wait(Stamp deadline) const {
    std::this_thread::sleep_until(std::min(due_, deadline));
    return std::chrono::steady_clock::now() < deadline;
  }

 private:
  static constexpr double k_first_pause_s = 0.1, k_longest_pause_s = 2;
  double pause_s_ = k_first_pause_s;
  Stamp due_ = std::chrono::steady_clock::now();
  std::string problem_ = "nothing has arrived yet.";
};

}  // namespace limn::device
