// The effort of a virtual session follows the times that frames take.
#include "session/pace_control.h"

#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "tests/session/studio.h"

namespace limn::session {
namespace {

constexpr double k_period_s = 1 / 30.0;
const std::vector<double> k_costs = {1, 0.8, 0.5, 0.25, 0.1};

// Plays frames whose times depend on the chosen effort. Returns how often the choice changed.
int played(int frames, const std::function<double(std::size_t)>& frame_s, PaceControl* control) {
  int changes = 0;
  for (int i = 0; i < frames; ++i) changes += control->add_frame(frame_s(control->chosen())) ? 1 : 0;
  return changes;
}

TEST(PaceControl, FallsUntilAFrameMeetsThePeriod) {
  for (std::size_t last = 0; last < k_costs.size(); ++last) {
    PaceControl control(k_costs, k_period_s, 0);
    const double whole_s = 0.99 * k_period_s / k_costs[last];
    played(
        1000, [&](std::size_t chosen) { return whole_s * k_costs[chosen]; }, &control);
    EXPECT_EQ(control.chosen(), last);
  }
}

TEST(PaceControl, FallsFarAtOnceWhenFramesTakeLong) {
  PaceControl control(k_costs, k_period_s, 0);
  const int changes = played(
      30, [&](std::size_t chosen) { return 9 * k_period_s * k_costs[chosen]; }, &control);
  EXPECT_EQ(control.chosen(), 4U);
  EXPECT_EQ(changes, 1);
}

TEST(PaceControl, StaysAtTheLeastEffortWhenEvenThatIsTooMuch) {
  PaceControl control(k_costs, k_period_s, 4);
  EXPECT_EQ(played(
                1000, [](std::size_t) { return 1.0; }, &control),
            0);
  EXPECT_EQ(control.chosen(), 4U);
}

TEST(PaceControl, RisesStepByStepWhenThereIsTimeToSpare) {
  PaceControl control(k_costs, k_period_s, 4);
  const auto fast = [](std::size_t) { return 0.2 * k_period_s; };
  EXPECT_EQ(played(45, fast, &control), 0) << "not at once";
  EXPECT_EQ(played(1000, fast, &control), 4);
  EXPECT_EQ(control.chosen(), 0U);
}

TEST(PaceControl, DoesNotRiseWhileSomebodyWorks) {
  PaceControl control(k_costs, k_period_s, 2);
  const auto fast = [](std::size_t) { return 0.2 * k_period_s; };
  for (int second = 0; second < 30; ++second) {
    EXPECT_EQ(played(30, fast, &control), 0);
    control.delay_rise();
  }
  EXPECT_EQ(played(1000, fast, &control), 2);
  for (int i = 0; i < 30; ++i) {  // it still falls
    played(
        1, [](std::size_t chosen) { return 1.5 * k_period_s * k_costs[chosen]; }, &control);
    control.delay_rise();
  }
  EXPECT_GT(control.chosen(), 0U);
}

TEST(PaceControl, ChangesNothingWhileFramesAreJustInTime) {
  PaceControl control(k_costs, k_period_s, 2);
  EXPECT_EQ(played(
                5000, [](std::size_t) { return 0.9 * k_period_s; }, &control),
            0);
}

TEST(PaceControl, ASlowFrameNowAndThenChangesNothing) {
  PaceControl control(k_costs, k_period_s, 2);
  int i = 0;
  EXPECT_EQ(played(
                5000, [&](std::size_t) { return ++i % 7 == 0 ? 0.5 : 0.9 * k_period_s; }, &control),
            0);
}

// The costs promise that the larger effort is in time, but it is not.
TEST(PaceControl, DoesNotSwingWhenARiseIsTooMuch) {
  PaceControl control(k_costs, k_period_s, 3);
  const auto frame_s = [](std::size_t chosen) { return (chosen == 3 ? 0.35 : 1.5) * k_period_s; };
  const int changes = played(10 * 60 * 30, frame_s, &control);
  EXPECT_GE(changes, 4) << "it tries";
  EXPECT_LE(changes, 20) << "in ten minutes";
}

TEST(PaceControl, FramesAfterAChangeOfSizeDoNotCount) {
  PaceControl control(k_costs, k_period_s, 1);
  for (int i = 0; i < 50; ++i) {
    control.forget_frames();
    EXPECT_EQ(played(
                  3, [](std::size_t) { return 2.0; }, &control),
              0);
    EXPECT_EQ(played(
                  9, [](std::size_t) { return 0.9 * k_period_s; }, &control),
              0);
  }
}

TEST(Efforts, FallInCostAndTheResolutionFallsLast) {
  const Rig rig = studio_world(1).rig;
  const std::vector<Effort> efforts = efforts_for(rig, true);
  EXPECT_EQ(efforts.front(), Effort{});
  EXPECT_TRUE(sentence(efforts.front()).empty());
  for (std::size_t i = 1; i < efforts.size(); ++i) {
    EXPECT_LT(guessed_cost(efforts[i]), guessed_cost(efforts[i - 1]));
    EXPECT_LE(efforts[i].resolution, efforts[i - 1].resolution);
    EXPECT_FALSE(sentence(efforts[i]).empty());
  }
  EXPECT_EQ(efforts.back().resolution, 0.3);
  EXPECT_NE(sentence(efforts.back()).find("30 %"), std::string::npos);
  for (const Effort& effort : efforts_for(rig, false)) EXPECT_EQ(effort.resolution, 1);
}

}  // namespace
}  // namespace limn::session
