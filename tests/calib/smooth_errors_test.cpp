#include "calib/judge/smooth_errors.h"

#include <gtest/gtest.h>

#include "tests/calib/true_rig.h"
#include "tests/support/matchers.h"

namespace limn::test {
namespace {

using Eigen::Vector2d;

// A solution without outliers, and held-out errors that a test fills.
struct Judged {
  calib::Observations observations = observed_perfectly(make_true_rig({.poses = 3}), 4);
  calib::Solution solution;
  calib::CrossValidation held_out;

  Judged() {
    solution.match_outlier.assign(observations.matches.size(), false);
    held_out.residuals.assign(observations.matches.size(), Vector2d::Zero());
  }
};

TEST(SmoothErrors, AnErrorThatCurvesOverTheBoardIsKept) {
  Judged judged;
  const auto error_at = [](const Vector2d& px) {
    return Vector2d(0.02 + 1e-4 * px.x() - 2e-7 * px.x() * px.y(), 3e-7 * px.y() * px.y() - 0.05);
  };
  for (size_t i = 0; i < judged.held_out.residuals.size(); ++i)
    judged.held_out.residuals[i] = error_at(judged.observations.matches[i].px_camera);
  const auto groups = calib::smooth_errors(judged.observations, judged.solution, judged.held_out);
  ASSERT_EQ(groups.size(), 3U);
  for (const calib::SmoothErrors& group : groups) {
    EXPECT_LT(group.noise, 1e-12);
    for (size_t i = 0; i < group.matches.size(); ++i) {
      const Vector2d expected = error_at(judged.observations.matches[group.matches[i]].px_camera);
      EXPECT_LT((group.residuals.row(static_cast<Eigen::Index>(i)).transpose() - expected).norm(), 1e-9);
    }
  }
}

TEST(SmoothErrors, NoiseLeavesAsMuchAsIsSaid) {
  Judged judged;
  std::mt19937_64 rng = test_rng();
  std::normal_distribution<double> scatter(0, 0.08);
  double smooth = 0, said = 0, all = 0;
  for (int draw = 0; draw < 20; ++draw) {
    for (Vector2d& residual : judged.held_out.residuals) {
      residual = {scatter(rng), scatter(rng)};
      all += residual.squaredNorm();
    }
    for (const auto& group : calib::smooth_errors(judged.observations, judged.solution, judged.held_out)) {
      smooth += group.residuals.squaredNorm();
      said += group.noise;
    }
  }
  // 20 draws of 3 boards of 12 polynomials: 720 squares, which scatter by 5 %.
  EXPECT_NEAR(smooth / said, 1, 0.2);
  EXPECT_LT(smooth, 0.1 * all);
}

TEST(SmoothErrors, OutliersAndSmallGroupsDoNotCount) {
  Judged judged;
  int kept = 0;
  for (size_t i = 0; i < judged.observations.matches.size(); ++i) {
    const bool is_first = judged.observations.matches[i].pose == 0;
    if (is_first && ++kept > 17) judged.held_out.residuals[i].setConstant(std::nan(""));
    if (!is_first && i % 2 == 0) {
      judged.solution.match_outlier[i] = true;
      judged.held_out.residuals[i] = {5, 5};
    }
  }
  const auto groups = calib::smooth_errors(judged.observations, judged.solution, judged.held_out);
  ASSERT_EQ(groups.size(), 2U);
  for (const calib::SmoothErrors& group : groups) EXPECT_LT(group.residuals.norm(), 1e-12);
}

}  // namespace
}  // namespace limn::test
