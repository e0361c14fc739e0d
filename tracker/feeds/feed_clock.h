#pragma once

#include <deque>
#include <optional>
#include <string>

#include "core/frame.h"

namespace limn::tracker {

/// The clock of another tracking system, compared with the arrival of its messages. A message can be late but
/// not early, so the smallest difference between arrival and stated time within two seconds takes one to the
/// other; a constant part of the delay and a slow drift are in it. Times that jump, stand still or run at
/// another rate are used only as far as they agree with the arrivals: after the third disagreement no more.
class FeedClock {
 public:
  /// The moment of a message on our clock, at most `arrived_at`: by its stated time, or its arrival where it
  /// states none or the times are not trusted. `arrived_at` must not go back.
  Stamp moment_of(std::optional<double> time_s, Stamp arrived_at);

  bool is_trusted() const { return disagreements_ < k_most_disagreements; }
  /// Whether the newest message stated a time that was used.
  bool has_times() const { return has_times_; }
  /// What people should know, once.
  std::optional<std::string> take_note();

 private:
  struct Least {
    Stamp from;        // the begin of this part of the window
    double lag_s = 0;  // the smallest in it
  };
  void disagree(const std::string& how);
  void add(double lag_s, Stamp arrived_at);
  double smallest() const;

  static constexpr int k_most_disagreements = 3;
  std::deque<Least> least_;
  int disagreements_ = 0;
  bool has_times_ = false;
  std::optional<std::string> note_;
};

}  // namespace limn::tracker
