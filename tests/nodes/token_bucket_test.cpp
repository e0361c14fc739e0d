#include "nodes/token_bucket.h"

#include <gtest/gtest.h>

namespace limn::nodes {
namespace {

Stamp at(double seconds) { return shifted(Stamp{}, 100 + seconds); }

TEST(TokenBucket, LetsABurstThroughAndThenTheRate) {
  TokenBucket bucket(1000, 500);
  EXPECT_EQ(bucket.delay_s(500, at(0)), 0);
  EXPECT_NEAR(bucket.delay_s(100, at(0)), 0.1, 1e-9);
  EXPECT_NEAR(bucket.delay_s(100, at(0)), 0.2, 1e-9);  // behind the one before
  EXPECT_NEAR(bucket.delay_s(100, at(0.25)), 0.05, 1e-9);
}

TEST(TokenBucket, SavesNoMoreThanABurstAndSurvivesAClockThatSteps) {
  TokenBucket bucket(1000, 500);
  EXPECT_EQ(bucket.delay_s(100, at(0)), 0);
  EXPECT_EQ(bucket.delay_s(500, at(60)), 0);
  EXPECT_NEAR(bucket.delay_s(500, at(60)), 0.5, 1e-9);
  EXPECT_NEAR(bucket.delay_s(100, at(-5)), 0.6, 1e-9);
  EXPECT_NEAR(bucket.delay_s(100, at(-4)), 0, 1e-9);
}

}  // namespace
}  // namespace limn::nodes
