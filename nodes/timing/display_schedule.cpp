#include "nodes/timing/display_schedule.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

namespace limn::nodes {
namespace {

constexpr std::size_t k_most = 40;    // calls that are remembered
constexpr std::size_t k_enough = 12;  // to know whether the display has refreshes
constexpr double k_half_frame_s = 0.5 / 60;
constexpr double k_fixed_s = 0.5e-3;       // a delay that varies by less has nothing to do with refreshes
constexpr double k_least_coherence = 0.9;  // between the shown moments and a refresh rate (1: all in phase)
constexpr std::array k_rates_hz = {24.0, 25.0, 30.0, 50.0,  59.94, 60.0, 72.0,
                                   75.0, 85.0, 90.0, 100.0, 120.0, 144.0};

}  // namespace

Stamp DisplaySchedule::call_at(Stamp wanted) const {
  if (!refresh_s_) return shifted(wanted, -latency_s());
  // Light comes at refreshes; the newest one is known. The call is half a refresh before the latest moment at
  // which it would still make the refresh that is nearest to the wanted moment.
  const Stamp refreshed_at = shown_.back().shown_at;
  const double count = std::round(seconds_between(refreshed_at, wanted) / *refresh_s_);
  return shifted(refreshed_at, count * *refresh_s_ - least_latency_s_ - 0.5 * *refresh_s_);
}

bool DisplaySchedule::is_too_late(Stamp wanted, Stamp now) const {
  return seconds_between(wanted, shifted(now, refresh_s_ ? least_latency_s_ : latency_s())) > k_half_frame_s;
}

void DisplaySchedule::note(Stamp called_at, Stamp shown_at) {
  const double latency = seconds_between(called_at, shown_at);
  least_latency_s_ = shown_.empty() ? latency : std::min(least_latency_s_, latency);
  shown_.push_back({called_at, shown_at});
  if (shown_.size() > k_most) shown_.pop_front();
  find_refresh();
}

double DisplaySchedule::latency_s() const {
  double sum = 0;
  for (const Shown& shown : shown_) sum += seconds_between(shown.called_at, shown.shown_at);
  return shown_.empty() ? 0 : sum / static_cast<double>(shown_.size());
}

// Whether the shown moments are in phase with a rate.
bool DisplaySchedule::is_in_phase(double rate_hz) const {
  std::complex<double> sum = 0;
  for (const Shown& shown : shown_)
    sum += std::polar(
        1.0, 2 * std::numbers::pi * rate_hz * seconds_between(shown_.back().shown_at, shown.shown_at));
  return std::abs(sum) >= k_least_coherence * static_cast<double>(shown_.size());
}

// The lowest rate with which the shown moments are in phase: they are in phase with its multiples, too. Once
// it is known the calls are made regularly, and their delays no longer show it.
void DisplaySchedule::find_refresh() {
  if (refresh_s_ && is_in_phase(1 / *refresh_s_)) return;
  refresh_s_.reset();
  if (shown_.size() < k_enough) return;
  double most = 0;
  for (const Shown& shown : shown_) most = std::max(most, seconds_between(shown.called_at, shown.shown_at));
  if (most - least_latency_s_ < k_fixed_s) return;
  const auto rate = std::ranges::find_if(k_rates_hz, [&](double hz) { return is_in_phase(hz); });
  if (rate != k_rates_hz.end()) refresh_s_ = 1 / *rate;
}

}  // namespace limn::nodes
