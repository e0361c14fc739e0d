#include "calib/judge/normalised_residuals.h"

#include <gtest/gtest.h>

#include "calib/judge/assess.h"
#include "tests/calib/observed_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;
using namespace worlds;

constexpr double k_corner_px = 0.05, k_match_px = 0.1;

NormalisedResiduals pulls_of(const World& world) {
  const auto solution = solve(world.observations);
  EXPECT_TRUE(solution.ok()) << solution.message();
  const auto score = cross_validate(world.observations, {}, *solution);
  EXPECT_TRUE(score.ok()) << score.message();
  return normalised_residuals(world.observations, *solution, score->residuals);
}

TEST(NormalisedResiduals, AreStandardNormalWhereTheNoiseIsAsStated) {
  World world = make_world(1, 1, 6, 0.3);
  add_noise(&world, k_corner_px, k_match_px, test_rng());
  const NormalisedResiduals found = pulls_of(world);
  for (const ResidualStatistics& s : {found.corners, found.matches, found.held_out}) {
    EXPECT_GT(s.count, 600);
    EXPECT_NEAR(s.mean, 0, 0.1);
    EXPECT_LT(s.beyond_3, 0.01);
  }
  EXPECT_NEAR(found.corners.stddev, 1, 0.06);
  EXPECT_NEAR(found.matches.stddev, 1, 0.06);
  EXPECT_NEAR(found.held_out.stddev, 1, 0.12);
}

// Few poses and noisy corners: predictions scatter by far more than the matches' own noise, and the stated
// covariance includes that.
TEST(NormalisedResiduals, OfHeldOutPosesKnowWhatCornersAndDevicesLeaveOpen) {
  World world = make_world(1, 1, 4, 0.3);
  add_noise(&world, 0.3, 0.02, test_rng());
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  const auto score = cross_validate(world.observations, {}, *solution);
  ASSERT_TRUE(score.ok()) << score.message();
  EXPECT_GT(score->rms_px, 4 * 0.02 * std::sqrt(2));
  const NormalisedResiduals found = normalised_residuals(world.observations, *solution, score->residuals);
  EXPECT_GT(found.held_out.stddev, 0.5);
  EXPECT_LT(found.held_out.stddev, 1.8);
}

TEST(NormalisedResiduals, GrowWhereTheLensModelIsTooPoor) {
  World world = make_world(1, 1, 5, 0.0);
  add_noise(&world, 0.02, 0.02, test_rng());
  SolveOptions poor;
  poor.projector_model = "LENSMODEL_PINHOLE";  // the true lens has k1 -0.06
  const auto solution = solve(world.observations, poor);
  ASSERT_TRUE(solution.ok()) << solution.message();
  const auto score = cross_validate(world.observations, poor, *solution);
  ASSERT_TRUE(score.ok()) << score.message();
  const NormalisedResiduals found = normalised_residuals(world.observations, *solution, score->residuals);
  EXPECT_GT(found.held_out.beyond_3, 0.01);
}

}  // namespace
}  // namespace limn::calib
