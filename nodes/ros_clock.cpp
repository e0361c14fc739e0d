#include "nodes/ros_clock.h"

#include <fmt/format.h>

#include <chrono>

namespace limn::nodes {
namespace {

constexpr double k_oldest_s = 2, k_most_ahead_s = 0.02;
constexpr std::int64_t k_stamp_ns_per_s = 1'000'000'000;

std::string wrongness(bool is_zero, bool is_repeated, double age_s) {
  if (is_zero) return "is 0";
  if (is_repeated) return "is not later than the image's before";
  return age_s < 0 ? fmt::format("lies {:.2f} s in the future", -age_s)
                   : fmt::format("is {:.2f} s old", age_s);
}

}  // namespace

Stamp RosClock::captured_at(std::int32_t s, std::uint32_t ns, Stamp arrived_at, std::int64_t wall_at_zero) {
  const std::chrono::nanoseconds since_zero(s * k_stamp_ns_per_s + ns - wall_at_zero);
  const Stamp stamped_at = Stamp(since_zero);
  const double age_s = seconds_between(stamped_at, arrived_at);
  const bool is_zero = s == 0 && ns == 0, is_repeated = stamped_at <= captured_at_;
  const bool counts = age_s >= 0 && age_s <= k_oldest_s && !is_repeated;
  const bool is_synchronised = age_s < 0 && age_s >= -k_most_ahead_s;
  if (!counts && !is_synchronised && problem_.empty()) problem_ = wrongness(is_zero, is_repeated, age_s);
  captured_at_ = counts ? stamped_at : arrived_at;
  return captured_at_;
}

std::int64_t wall_at_zero_ns() {
  constexpr double k_at_once_s = 50e-6;
  std::int64_t out = 0;
  for (int i = 0; i < 10; ++i) {  // again if the process was interrupted between the two clocks
    const Stamp before = now();
    const auto wall = std::chrono::system_clock::now().time_since_epoch();
    out = std::chrono::duration_cast<std::chrono::nanoseconds>(wall).count() -
          before.time_since_epoch().count();
    if (seconds_between(before, now()) < k_at_once_s) break;
  }
  return out;
}

}  // namespace limn::nodes
