#include "device/wall_clock.h"

#include <gtest/gtest.h>

namespace limn::device {
namespace {

using Wall = std::chrono::system_clock;
constexpr double k_regulated_s = 1e-3;  // the rate of the wall clock is adjusted by NTP

TEST(WallClock, AMomentKeepsItsPlaceAmongOthers) {
  for (int i = 0; i < 1000; ++i) {
    const Stamp before = now();
    const auto wall = Wall::now().time_since_epoch();
    const Stamp after = now();
    const Stamp found = from_wall_clock(wall - std::chrono::milliseconds(300), 10);
    EXPECT_GT(seconds_between(before, found), -0.3 - k_regulated_s);
    EXPECT_LT(seconds_between(after, found), -0.3 + k_regulated_s);
  }
}

TEST(WallClock, MomentsThatCannotBeAreNow) {
  for (const auto apart :
       {std::chrono::seconds(5), std::chrono::seconds(-12), std::chrono::seconds(-1'000'000)}) {
    const Stamp before = now();
    const Stamp found = from_wall_clock(Wall::now().time_since_epoch() + apart, 10);
    EXPECT_GE(found, before);
    EXPECT_LE(found, now());
  }
}

}  // namespace
}  // namespace limn::device
