#include "calib/judge/uncertainty.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "calib/judge/assess.h"
#include "calib/model_selection.h"
#include "calib/solve.h"
#include "tests/calib/true_rig.h"
#include "tests/support/matchers.h"

namespace limn::test {
namespace {

constexpr double k_pnp_px = 0.02;

// Observations as good images give them, solved and assessed.
struct Calibrated {
  TrueRig truth;
  calib::Observed observed;
  calib::Solution solution;
  calib::Assessment assessment;
};

Calibrated calibrated(const RigOptions& rig,
                      double corner_px,
                      double match_px,
                      std::mt19937_64* rng,
                      const calib::SolveOptions& options = {}) {
  Calibrated made;
  made.truth = make_true_rig(rig);
  made.observed.observations = observed_perfectly(made.truth, 8);
  add_noise(corner_px, match_px, rng, &made.observed.observations);
  for (calib::Match& match : made.observed.observations.matches) match.stddev_px = match_px;
  const auto solution = calib::solve(made.observed.observations, options);
  EXPECT_TRUE(solution.ok()) << solution.message();
  made.solution = *solution;
  const auto assessment = calib::assess(made.observed, options, *solution);
  EXPECT_TRUE(assessment.ok()) << assessment.message();
  made.assessment = *assessment;
  return made;
}

TEST(Propagate, TheNinetyFivePercentOfRoundAndOfThinScatterAreTheTextbooks) {
  const std::vector<Eigen::Matrix2d> round = {4 * Eigen::Matrix2d::Identity()};
  EXPECT_NEAR(calib::p95_of({&round, 1}), 2 * 2.4477, 1e-3);  // Rayleigh
  Eigen::Matrix2d line = Eigen::Matrix2d::Zero();
  line(0, 0) = 9;
  const std::vector<Eigen::Matrix2d> thin = {line};
  EXPECT_NEAR(calib::p95_of({&thin, 1}), 3 * 1.95996, 2e-2);
  const std::vector<std::vector<Eigen::Matrix2d>> none(2);
  EXPECT_TRUE(std::isinf(calib::p95_of(none)));
}

// The jackknife covariance of a mean is exactly the textbook's variance of the mean.
TEST(Propagate, TheJackknifeOfAMeanIsTheVarianceOfTheMean) {
  calib::Solution solution;
  solution.rig = make_true_rig({}).rig;
  solution.covariance.setZero(28, 28);
  const std::vector<double> samples = {1.0, 3.0, 4.5, 2.0, 7.0};
  std::vector<Rig> without;
  for (size_t i = 0; i < samples.size(); ++i) {
    Rig rig = solution.rig;
    double sum = 0;
    for (size_t k = 0; k < samples.size(); ++k) sum += k == i ? 0 : samples[k];
    rig.projectors[0].lens.values[2] += sum / 4;
    without.push_back(rig);
  }
  const Eigen::MatrixXd covariance = calib::jackknife_covariance(solution, without);
  const int at = solution.projector_at(0) + 2;
  EXPECT_NEAR(covariance(at, at), 1.1, 1e-9);  // sample variance 5.5 over 5
  EXPECT_NEAR(covariance.squaredNorm(), 1.1 * 1.1, 1e-9);
}

// Rigs drawn from a covariance, each used and measured on its own, are compared with the predicted error.
TEST(Propagate, DrawnRigsMissByWhatTheCovarianceSays) {
  const TrueRig truth = make_true_rig({.k1 = -0.05, .shift = 0.5});
  calib::Solution solution;
  solution.rig = truth.rig;
  for (const Pose& pose : truth.world_from_board) solution.world_from_board.emplace_back(pose);
  Eigen::VectorXd stddev = Eigen::VectorXd::Zero(28);
  stddev.segment(0, 4).setConstant(0.8);    // camera: focal lengths and centre, px
  stddev.segment(14, 4).setConstant(0.4);   // projector, the same
  stddev.segment(22, 3).setConstant(1e-4);  // its pose, rad
  stddev.segment(25, 3).setConstant(1e-4);  // and m
  solution.covariance = stddev.cwiseAbs2().asDiagonal();
  std::mt19937_64 rng = test_rng();
  std::normal_distribution<double> scatter(0, 1);
  const scene::Mesh mesh = prototype_mesh(Prototype::concave);
  std::vector<double> errors;
  for (int draw = 0; draw < 40; ++draw) {
    Rig rig = truth.rig;
    Vector6d delta = Vector6d::Zero();
    for (int i = 0; i < 4; ++i) {
      rig.cameras[0].lens.values[static_cast<size_t>(i)] += stddev[i] * scatter(rng);
      rig.projectors[0].lens.values[static_cast<size_t>(i)] += stddev[14 + i] * scatter(rng);
    }
    for (int i = 0; i < 6; ++i) delta[i] = stddev[22 + i] * scatter(rng);
    rig.projectors[0].imager_from_world = boxplus(rig.projectors[0].imager_from_world, delta);
    for (const double e : landed(truth, rig, mesh, k_pnp_px, 120, &rng).pooled_mm()) errors.push_back(e);
  }
  const auto observations = observed_perfectly(truth, 8);
  const double predicted =
      calib::propagated_error_mm(observations, solution, {solution.covariance, k_pnp_px})[0];
  printf("[ propagate] predicted p95 %.3f mm, drawn %.3f mm\n", predicted, p95(errors));
  // 40 draws of about 8 free directions: one standard deviation of their 95 % is about 10 %; and the
  // prototype differs from the target that the propagation assumes.
  EXPECT_NEAR(p95(errors) / predicted, 1.0, 0.35);
}

TEST(Propagate, TheStatedErrorHoldsForNinetyToNinetyEightPercentOfUnseenPoints) {
  std::mt19937_64 rng = test_rng();
  std::vector<double> ratios;  // errors divided by the stated error
  constexpr int k_cases = 8;
  for (int i = 0; i < k_cases; ++i) {
    const RigOptions rig{.k1 = -0.05 * (i % 4),
                         .shift = 0.55 * (i % 3),
                         .bow_m = 0.4e-3 * (i % 2),
                         .poses = 8 + 2 * (i % 3),
                         .seed = static_cast<unsigned>(100 + i)};
    const double corner_px =
        0.02 + 0.02 * (i % 3);  // the prototype's points are measured as well as the board's
    const Calibrated made = calibrated(rig, corner_px, 0.03 + 0.03 * (i % 2), &rng);
    const double stated = made.assessment.predicted_error_mm[0];
    const scene::Mesh mesh = prototype_mesh(static_cast<Prototype>(i % 3));
    std::vector<double> errors =
        landed(made.truth, made.solution.rig, mesh, std::max(k_pnp_px, corner_px), 400, &rng).pooled_mm();
    printf("[ stated   ] %.3f mm, p95 %.3f mm, holds for %.1f %%\n", stated, p95(errors),
           100 * share_within(errors, stated));
    for (const double e : errors) ratios.push_back(e / stated);
  }
  printf("[ stated   ] over %d rigs it holds for %.1f %%\n", k_cases, 100 * share_within(ratios, 1));
  EXPECT_GE(share_within(ratios, 1), 0.90);
  EXPECT_LE(share_within(ratios, 1), 0.99);  // 8 rigs: a rig's share scatters by about 3 %
}

TEST(Propagate, IllPosedSetsAreNeverGoodAndSayHowFarTheyMiss) {
  std::mt19937_64 rng = test_rng();
  const Calibrated healthy = calibrated({.shift = 0.5, .seed = 4}, 0.02, 0.03, &rng);
  EXPECT_EQ(healthy.assessment.verdict, calib::Verdict::good);
  for (const double tilt : {0.05, 0.1}) {
    for (const unsigned seed : {4U, 5U}) {
      const Calibrated made = calibrated(
          {.k1 = -0.05, .shift = 0.5, .tilt = tilt, .spread = 0.15, .seed = seed}, 0.02, 0.03, &rng);
      const scene::Mesh mesh = prototype_mesh(Prototype::concave);
      const auto errors = landed(made.truth, made.solution.rig, mesh, k_pnp_px, 400, &rng).pooled_mm();
      const double stated = made.assessment.predicted_error_mm[0];
      printf("[ ill-posed] tilt %.2f: %s, stated %.3f mm (held-out %.3f mm), p95 %.3f mm\n", tilt,
             calib::to_text(made.assessment.verdict).c_str(), stated, made.assessment.held_out_error_mm[0],
             p95(errors));
      EXPECT_NE(made.assessment.verdict, calib::Verdict::good);
      EXPECT_GT(stated, 2 * healthy.assessment.predicted_error_mm[0]);
    }
  }
}

// Distortion that five poses show is kept, though their held-out errors differ too much to prove it.
TEST(Propagate, DistortionThatFewPosesShowIsKept) {
  std::mt19937_64 rng = test_rng();
  const TrueRig truth = make_true_rig({.k1 = -0.05, .poses = 5, .seed = 8});
  calib::Observations observations = observed_perfectly(truth, 4);
  add_noise(0.05, 0.1, &rng, &observations);
  const auto choice = calib::solve_selecting_models(observations, {.projector_model = calib::k_auto_lens});
  ASSERT_TRUE(choice.ok()) << choice.message();
  EXPECT_NE(choice->solution.rig.projectors[0].lens.model.name(), "LENSMODEL_PINHOLE");
}

// A chosen pinhole is stated as what it is known to be: a lens without visible distortion.
TEST(Propagate, APinholeIsNotCertain) {
  std::mt19937_64 rng = test_rng();
  const TrueRig truth = make_true_rig({.poses = 5, .seed = 8});
  calib::Observations observations = observed_perfectly(truth, 4);
  add_noise(0.05, 0.1, &rng, &observations);
  const auto solution = calib::solve(observations, {.projector_model = "LENSMODEL_PINHOLE"});
  ASSERT_TRUE(solution.ok()) << solution.message();
  const calib::Solution freed = calib::with_distortion_unknown(observations, *solution);
  EXPECT_EQ(freed.rig.projectors[0].lens.model.name(), "LENSMODEL_OPENCV4");
  const double certain = calib::propagated_error_mm(observations, *solution, {solution->covariance, 0})[0],
               stated = calib::propagated_error_mm(observations, freed, {freed.covariance, 0})[0];
  printf("[ pinhole  ] stated %.3f mm, %.3f mm if it were certain\n", stated, certain);
  EXPECT_GT(stated, 1.01 * certain);
  const auto rich = calib::solve(observations);
  ASSERT_TRUE(rich.ok()) << rich.message();
  EXPECT_EQ(calib::with_distortion_unknown(observations, *rich).covariance, rich->covariance);
}

// One board that moved while it was captured is a fault with a name; it does not make a sound rig's statement
// many times too large.
TEST(Propagate, AnOddPoseHardlyWidensTheStatement) {
  std::mt19937_64 rng = test_rng();
  const RigOptions rig{.k1 = -0.05, .shift = 0.5, .seed = 3};
  const TrueRig truth = make_true_rig(rig);
  calib::Observations observations = observed_perfectly(truth, 8);
  add_noise(0.02, 0.05, &rng, &observations);
  const auto stated = [](const calib::Observations& all) {
    const calib::Solution solution = calib::solve(all).value();
    const calib::Assessment assessment = calib::assess({all, {}, {}, 0, 0}, {}, solution).value();
    return std::pair(assessment.predicted_error_mm[0], assessment.held_out.worst_px);
  };
  const auto [sound_mm, sound_px] = stated(observations);
  for (calib::Match& match : observations.matches) {
    if (match.pose == 4) match.px_projector += Eigen::Vector2d(1.5, -1);
  }
  const auto [odd_mm, odd_px] = stated(observations);
  printf("[ odd pose ] stated %.3f mm, without it %.3f mm; worst pose %.2f and %.2f px\n", odd_mm, sound_mm,
         odd_px, sound_px);
  EXPECT_GT(odd_px, 5 * sound_px);
  EXPECT_LT(odd_mm, 2 * sound_mm);
}

// Errors that all matches of a placement share, as decoding leaves them, count as one error each and not as
// hundreds.
TEST(Propagate, ErrorsThatMatchesShareAreInTheUncertainty) {
  std::mt19937_64 rng = test_rng();
  std::vector<double> ratios;
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    const TrueRig truth = make_true_rig({.k1 = -0.05, .shift = 0.5, .poses = 20, .seed = seed});
    calib::Observations observations = observed_perfectly(truth, 8);
    add_noise(0.005, 0.012, &rng, &observations);
    add_shared_errors(0.015, &rng, &observations);
    for (calib::Match& match : observations.matches) match.stddev_px = 0.012;
    const auto solution = calib::solve(observations);
    ASSERT_TRUE(solution.ok()) << solution.message();
    const auto held_out = calib::cross_validate(observations, {}, *solution);
    ASSERT_TRUE(held_out.ok()) << held_out.message();
    const calib::Uncertainty uncertainty =
        calib::estimated_uncertainty(observations, *solution, {}, *held_out);
    const double stated = calib::propagated_error_mm(observations, *solution, {uncertainty.covariance, 0})[0];
    const scene::Mesh mesh = prototype_mesh(static_cast<Prototype>(seed % 3));
    const auto errors = landed(truth, solution->rig, mesh, 0, 400, &rng).pooled_mm();
    printf("[ shared   ] calibration alone: stated %.4f mm, p95 %.4f mm, of scatter %.4f mm\n", stated,
           p95(errors), calib::propagated_error_mm(observations, *solution, {solution->covariance, 0})[0]);
    for (const double e : errors) ratios.push_back(e / stated);
  }
  printf("[ shared   ] holds for %.1f %%\n", 100 * share_within(ratios, 1));
  EXPECT_GE(share_within(ratios, 1), 0.88);
}

// Noise of single matches that they do not state, as JPEG and shake leave it, averages out over the boards.
TEST(Propagate, NoiseThatMatchesDoNotStateHardlyWidensTheStatement) {
  std::mt19937_64 rng = test_rng();
  std::vector<double> ratios;
  double widest = 0;
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    const TrueRig truth = make_true_rig({.k1 = -0.05, .shift = 0.5, .seed = seed});
    calib::Observed observed;
    observed.observations = observed_perfectly(truth, 2);
    add_noise(0.01, 0.1, &rng, &observed.observations);
    for (calib::Match& match : observed.observations.matches) match.stddev_px = 0.02;
    const auto solution = calib::solve(observed.observations);
    ASSERT_TRUE(solution.ok()) << solution.message();
    const auto assessment = calib::assess(observed, {}, *solution);
    ASSERT_TRUE(assessment.ok()) << assessment.message();
    const double stated = assessment->predicted_error_mm[0];
    const scene::Mesh mesh = prototype_mesh(static_cast<Prototype>(seed % 3));
    const auto errors = landed(truth, solution->rig, mesh, k_pnp_px, 400, &rng).pooled_mm();
    printf("[ unstated ] stated %.4f mm (held-out %.4f mm), p95 %.4f mm\n", stated,
           assessment->held_out_error_mm[0], p95(errors));
    widest = std::max(widest, stated / p95(errors));
    for (const double e : errors) ratios.push_back(e / stated);
  }
  EXPECT_GE(share_within(ratios, 1), 0.90);
  EXPECT_LT(widest, 2.5);
}

TEST(Propagate, ABuildThatIgnoresProjectorDistortionFailsTheMovedCheck) {
  std::mt19937_64 rng = test_rng();
  const RigOptions rig{.k1 = -0.15, .shift = 0.5, .seed = 6};
  std::mt19937_64 again = rng;
  const Calibrated right = calibrated(rig, 0.02, 0.03, &rng);
  const Calibrated wrong = calibrated(rig, 0.02, 0.03, &again, {.projector_model = "LENSMODEL_PINHOLE"});
  const scene::Mesh mesh = prototype_mesh(Prototype::panel);
  const Landed with = landed(right.truth, right.solution.rig, mesh, k_pnp_px, 400, &rng);
  const Landed without = landed(wrong.truth, wrong.solution.rig, mesh, k_pnp_px, 400, &rng);
  printf("[ pinhole  ] moved %.3f mm RMS, with distortion %.3f mm; stated %.3f and %.3f mm\n",
         rms(without.moved_mm), rms(with.moved_mm), wrong.assessment.predicted_error_mm[0],
         right.assessment.predicted_error_mm[0]);
  EXPECT_GT(rms(without.moved_mm), 3 * rms(with.moved_mm));
  EXPECT_GT(wrong.assessment.predicted_error_mm[0], 3 * right.assessment.predicted_error_mm[0]);
}

}  // namespace
}  // namespace limn::test
