// Stamps of ROS 2's cameras become the session's.
#include "nodes/ros_clock.h"

#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace limn::nodes {
namespace {

TEST(RosClock, StampsThatLieGiveWayToTheArrival) {
  constexpr std::int64_t k_wall = 1'700'000'000'000'000'000;  // ns, when the session's clock is 0
  const auto at = [](double s) { return shifted(Stamp{}, s); };
  RosClock clock;
  EXPECT_EQ(clock.captured_at(1'700'000'010, 500'000'000, at(10.54), k_wall), at(10.5));
  EXPECT_EQ(clock.captured_at(1'700'000'010, 600'000'000, at(10.59), k_wall),
            at(10.59));  // clocks 10 ms apart
  EXPECT_EQ(clock.problem(), "");
  EXPECT_EQ(clock.captured_at(0, 0, at(11), k_wall), at(11));
  EXPECT_EQ(clock.problem(), "is 0");
  EXPECT_EQ(clock.captured_at(1'700'000'011, 100'000'000, at(11.2), k_wall), at(11.1));  // counts again
  RosClock ahead, old, stuck;
  EXPECT_EQ(ahead.captured_at(1'700'000'020, 0, at(11), k_wall), at(11));
  EXPECT_EQ(ahead.problem(), "lies 9.00 s in the future");
  EXPECT_EQ(old.captured_at(1'699'999'900, 0, at(11), k_wall), at(11));
  EXPECT_EQ(old.problem(), "is 111.00 s old");
  EXPECT_EQ(stuck.captured_at(1'700'000'010, 0, at(10.1), k_wall), at(10));
  EXPECT_EQ(stuck.captured_at(1'700'000'010, 0, at(10.2), k_wall), at(10.2));
  EXPECT_EQ(stuck.problem(), "is not later than the image's before");
}

}  // namespace
}  // namespace limn::nodes
