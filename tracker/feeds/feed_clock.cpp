#include "tracker/feeds/feed_clock.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace limn::tracker {
namespace {

constexpr double k_window_s = 2, k_part_s = 0.1;
// A message may be late by this much; earlier than expected by more than a little only if a clock jumped.
constexpr double k_most_late_s = 0.5, k_most_early_s = 0.1;
// Within a second the smallest lag of clocks that run at one rate changes by less than this.
constexpr double k_most_drift = 0.02;

}  // namespace

Stamp FeedClock::moment_of(std::optional<double> time_s, Stamp arrived_at) {
  has_times_ = time_s.has_value() && is_trusted();
  if (!has_times_) return arrived_at;
  // Differences of stamps since the session's zero have the precision of 0.1 us for 10 years of stated time.
  const double lag_s = seconds_of(arrived_at) - *time_s;
  if (!least_.empty()) {
    const double later_s = lag_s - smallest();
    if (later_s > k_most_late_s || later_s < -k_most_early_s)
      disagree(fmt::format("its clock jumped by {:.1f} s", -later_s));
  }
  add(lag_s, arrived_at);
  return is_trusted() ? std::min(arrived_at, shifted(arrived_at, smallest() - lag_s)) : arrived_at;
}

std::optional<std::string> FeedClock::take_note() { return std::exchange(note_, std::nullopt); }

void FeedClock::disagree(const std::string& how) {
  least_.clear();
  ++disagreements_;
  note_ = how + (is_trusted() ? "" : "; its times are not used any more, but when its poses arrive");
}

void FeedClock::add(double lag_s, Stamp arrived_at) {
  if (least_.empty() || seconds_between(least_.back().from, arrived_at) >= k_part_s)
    least_.push_back({arrived_at, lag_s});
  least_.back().lag_s = std::min(least_.back().lag_s, lag_s);
  if (seconds_between(least_.front().from, arrived_at) <= k_window_s) return;
  double older = std::numeric_limits<double>::infinity(), newer = older;
  for (const Least& part : least_)
    (seconds_between(part.from, arrived_at) > k_window_s / 2 ? older : newer) =
        std::min(seconds_between(part.from, arrived_at) > k_window_s / 2 ? older : newer, part.lag_s);
  least_.pop_front();
  if (std::abs(newer - older) > k_most_drift * k_window_s / 2)
    disagree(fmt::format("its clock runs {:.0f} % too {}", 100 * std::abs(newer - older) / (k_window_s / 2),
                         newer > older ? "slowly" : "fast"));
}

double FeedClock::smallest() const {
  double least = std::numeric_limits<double>::infinity();
  for (const Least& part : least_) least = std::min(least, part.lag_s);
  return least;
}

}  // namespace limn::tracker
