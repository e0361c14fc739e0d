#include "nodes/timing/display_schedule.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "nodes/refresh.h"
#include "tests/support/matchers.h"

namespace limn::nodes {
namespace {

// A display with a clock of its own: an image that it gets is shown at its next refresh, 5 ms of electronics
// later. Without a rate it is shown 5 ms after the call.
struct FakeDisplay {
  double rate_hz = 60, phase_s = 0;
  double shown_at_s(double called_at_s) const {
    if (rate_hz == 0) return called_at_s + 5e-3;
    return std::ceil((called_at_s - phase_s) * rate_hz) / rate_hz + phase_s + 5e-3;
  }
};

double seconds(Stamp at) { return seconds_between(Stamp{}, at); }

// Calls the display for wanted moments at the frame rate of a session, with a jitter of the calls; returns
// how far each light is from the wanted moment.
std::vector<double> errors_s(const FakeDisplay& display,
                             double frame_s,
                             int frames,
                             std::mt19937_64* random) {
  DisplaySchedule schedule;
  std::exponential_distribution<double> late(1 / 0.3e-3);  // how much later than asked a thread wakes up
  std::vector<double> out;
  for (int i = 0; i < frames; ++i) {
    const Stamp wanted = shifted(Stamp{}, 1 + i * frame_s);
    const Stamp called_at = shifted(schedule.call_at(wanted), late(*random));
    const Stamp shown_at = shifted(Stamp{}, display.shown_at_s(seconds(called_at)));
    schedule.note(called_at, shown_at);
    out.push_back(seconds_between(wanted, shown_at));
  }
  return out;
}

double share_within(const std::vector<double>& errors, double limit_s, int from) {
  return static_cast<double>(std::count_if(errors.begin() + from, errors.end(),
                                           [&](double error) { return std::abs(error) <= limit_s; })) /
         static_cast<double>(errors.size() - static_cast<std::size_t>(from));
}

TEST(DisplaySchedule, MeetsTheWantedMomentOfADisplayWithoutRefresh) {
  std::mt19937_64 random = test::test_rng();
  EXPECT_GE(share_within(errors_s({.rate_hz = 0}, 1 / 30.0, 1000, &random), 1e-3, 20), 0.95);
}

// No refresh is farther from the wanted moment than half a period; the nearest one must be met.
TEST(DisplaySchedule, MeetsTheNearestRefresh) {
  for (const double rate : {50.0, 60.0, 59.94, 120.0})
    for (const double phase : {0.0, 3e-3, 9e-3}) {
      std::mt19937_64 random = test::test_rng();
      const auto errors = errors_s({rate, phase}, 1 / 29.3, 2000, &random);
      EXPECT_GE(share_within(errors, 0.5 / rate + 0.1e-3, 60), 0.97) << rate << " Hz, phase " << phase;
    }
}

// Displays whose refreshes are in phase (genlock) change together, though the calls of each have a jitter.
TEST(DisplaySchedule, TwoDisplaysInPhaseChangeTogether) {
  std::mt19937_64 random = test::test_rng();
  const auto left = errors_s({60, 2e-3}, 1 / 60.0, 3000, &random),
             right = errors_s({60, 2e-3}, 1 / 60.0, 3000, &random);
  std::vector<double> skews;
  for (std::size_t i = 0; i < left.size(); ++i) skews.push_back(left[i] - right[i]);
  EXPECT_GE(share_within(skews, 1e-3, 60), 0.99);
}

TEST(DisplaySchedule, SaysWhatIsTooLate) {
  DisplaySchedule schedule;
  for (int i = 0; i < 5; ++i) schedule.note(shifted(Stamp{}, i), shifted(Stamp{}, i + 0.02));
  EXPECT_NEAR(schedule.latency_s(), 0.02, 1e-9);
  const Stamp wanted = shifted(Stamp{}, 100);
  EXPECT_FALSE(schedule.is_too_late(wanted, shifted(wanted, -0.02)));
  EXPECT_FALSE(schedule.is_too_late(wanted, shifted(wanted, -0.013)));
  EXPECT_TRUE(schedule.is_too_late(wanted, shifted(wanted, -0.01)));
}

// ---- the refresh that a frame is planned for ----

double near_s(double expected_s, std::vector<Refresh> displays) {
  return seconds(refresh_near(shifted(Stamp{}, expected_s), displays));
}
Refresh refresh(double at_s, double period_s) { return {shifted(Stamp{}, at_s), period_s}; }

TEST(RefreshNear, IsARefreshThatLeavesTimeToDraw) {
  const std::vector<Refresh> display = {refresh(99.5, 0.02)};
  EXPECT_NEAR(near_s(100.000, display), 100.00, 1e-6);
  EXPECT_NEAR(near_s(100.004, display), 100.00, 1e-6);  // less than a quarter of a period early
  EXPECT_NEAR(near_s(100.006, display), 100.02, 1e-6);
  EXPECT_NEAR(near_s(100.015, display), 100.02, 1e-6);
}

TEST(RefreshNear, DisplaysOutOfStepAreMetInTheirMiddle) {
  EXPECT_NEAR(near_s(100, {refresh(99.996, 0.02), refresh(100.002, 0.02)}), 99.999, 1e-6);
  EXPECT_NEAR(near_s(100, {refresh(100.001, 0.02), refresh(99.996, 0.01)}), 100.001, 1e-6);
}

TEST(RefreshNear, WhatCannotBeIsIgnored) {
  EXPECT_EQ(near_s(100, {}), 100);
  for (const Refresh& wrong : {refresh(90, 0.02), refresh(99.99, 0), refresh(99.99, -1), refresh(99.99, 1e-9),
                               Refresh{Stamp::max(), 0.02}, Refresh{Stamp::min(), 0.02}, refresh(99.99, NAN)})
    EXPECT_EQ(near_s(100, {wrong}), 100);
  EXPECT_EQ(near_s(100, {refresh(99.99, 0.02), refresh(100, 0.02)}), 100);  // opposite phases
}

}  // namespace
}  // namespace limn::nodes
