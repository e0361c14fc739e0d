#include "nodes/refresh.h"

#include <cmath>
#include <complex>
#include <numbers>

namespace limn::nodes {
namespace {

constexpr double k_shortest_s = 1 / 500.0, k_longest_s = 1 / 10.0;  // periods that displays have
constexpr double k_oldest_refresh_s = 2;    // later a refresh says nothing of the phase any more
constexpr double k_same_rate = 0.02;        // relative difference of periods that count as one
constexpr double k_early_share = 0.25;      // share of a period by which it may be earlier than expected
constexpr double k_least_agreement = 0.05;  // with less the phases are all round the period

// Any two stamps have one, also those whose difference overflows.
double distance_s(Stamp from, Stamp to) {
  const auto ns = [](Stamp at) { return static_cast<double>(at.time_since_epoch().count()); };
  return 1e-9 * (ns(to) - ns(from));
}

bool is_usable(const Refresh& refresh, Stamp expected) {
  return refresh.period_s >= k_shortest_s && refresh.period_s <= k_longest_s &&
         std::abs(distance_s(refresh.at, expected)) <= k_oldest_refresh_s;
}

}  // namespace

Stamp refresh_near(Stamp expected, std::span<const Refresh> displays) {
  double period_s = 0;
  for (const Refresh& each : displays)
    if (is_usable(each, expected)) period_s = std::max(period_s, each.period_s);
  std::complex<double> sum = 0;
  int count = 0;
  for (const Refresh& each : displays) {
    if (!is_usable(each, expected) || each.period_s < (1 - k_same_rate) * period_s) continue;
    sum += std::polar(1.0, 2 * std::numbers::pi * distance_s(expected, each.at) / period_s);
    ++count;
  }
  if (count == 0 || std::abs(sum) < k_least_agreement * count) return expected;
  const double nearest_s = std::arg(sum) / (2 * std::numbers::pi) * period_s;
  return shifted(expected, nearest_s < -k_early_share * period_s ? nearest_s + period_s : nearest_s);
}

}  // namespace limn::nodes
