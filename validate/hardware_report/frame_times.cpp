#include "validate/hardware_report/frame_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace limn::validate {
namespace {

// The value that this share of them does not exceed.
double quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

}  // namespace

FrameRhythm frame_rhythm(const std::vector<FrameTime>& times) {
  FrameRhythm rhythm{.frames = static_cast<int>(times.size())};
  if (times.size() < 2) return rhythm;
  std::vector<double> distances, delays;
  for (std::size_t i = 1; i < times.size(); ++i)
    distances.push_back(seconds_between(times[i - 1].captured_at, times[i].captured_at));
  for (const FrameTime& time : times) delays.push_back(seconds_between(time.captured_at, time.arrived_at));
  rhythm.period_s = quantile(distances, 0.5);
  rhythm.longest_s = quantile(distances, 1);
  rhythm.delay_s = quantile(delays, 0.5);
  if (rhythm.period_s <= 0) return rhythm;
  std::vector<double> off;
  for (const double distance : distances) {
    off.push_back(std::abs(distance - rhythm.period_s));
    rhythm.missing += std::max(0, static_cast<int>(std::lround(distance / rhythm.period_s)) - 1);
  }
  rhythm.jitter_s = quantile(off, 0.95);
  return rhythm;
}

std::vector<std::string> odd_in(const FrameRhythm& rhythm) {
  constexpr double k_most_jitter = 0.2;    // share of the period; above it predicted poses tremble
  constexpr double k_most_missing = 0.01;  // share of the frames
  constexpr double k_longest_delay_s = 0.1;
  std::vector<std::string> odd;
  if (rhythm.frames < 2 || rhythm.period_s <= 0) return {"Frames: expected stamps that rise, found none."};
  if (rhythm.jitter_s > k_most_jitter * rhythm.period_s)
    odd.push_back(
        fmt::format("Frames: the stamps jitter by {:.1f} ms at a period of {:.1f} ms. A network camera "
                    "has no better stamps; a USB camera should have a port of its own.",
                    1e3 * rhythm.jitter_s, 1e3 * rhythm.period_s));
  if (rhythm.missing > k_most_missing * rhythm.frames)
    odd.push_back(
        fmt::format("Frames: {} of {} are missing. Use a shorter cable or a smaller image, and lock "
                    "the exposure below the frame period.",
                    rhythm.missing, rhythm.frames + rhythm.missing));
  if (rhythm.delay_s > k_longest_delay_s)
    odd.push_back(
        fmt::format("Frames: they arrive {:.0f} ms after they were captured; up to 60 ms is usual. "
                    "Parts will lag behind the hand.",
                    1e3 * rhythm.delay_s));
  return odd;
}

std::string frame_times_csv(const std::vector<FrameTime>& times) {
  std::string csv = "captured_at_s,arrived_at_s\n";
  for (const FrameTime& time : times)
    csv += fmt::format("{:.6f},{:.6f}\n", seconds_between(times.front().captured_at, time.captured_at),
                       seconds_between(times.front().captured_at, time.arrived_at));
  return csv;
}

}  // namespace limn::validate
