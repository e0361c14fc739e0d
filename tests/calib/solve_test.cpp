#include "calib/solve.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>

#include "calib/judge/assess.h"
#include "calib/seed.h"
#include "tests/calib/observed_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;
using namespace limn::calib::worlds;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_infinite = std::numeric_limits<double>::infinity();

SolveOptions without_priors() {
  SolveOptions options;
  options.camera_centre = options.projector_centre = options.aspect = options.radial = options.tangential =
      options.projector_radial = options.projector_tangential = options.bend_share = k_infinite;
  return options;
}

void expect_same_lens(const Imager& found, const Imager& expected, double pixels, double distortion) {
  ASSERT_EQ(found.lens.values.size(), expected.lens.values.size());
  for (size_t i = 0; i < found.lens.values.size(); ++i)
    EXPECT_NEAR(found.lens.values[i], expected.lens.values[i], i < 4 ? pixels : distortion)
        << expected.name << " value " << i;
}

TEST(Seed, TheLinearTransformRecoversAShiftedProjectorExactly) {
  const Pose pose(exp_rotation({0.2, -0.3, 0.1}), Vector3d(0.1, -0.2, 0.3));
  const Lens lens = Lens::pinhole(1500, 1510, 640, 1280);
  std::vector<Vector3d> points;
  std::vector<Vector2d> pixels;
  std::mt19937_64 rng = test_rng();
  std::uniform_real_distribution<double> share(-0.3, 0.3);
  for (int i = 0; i < 50; ++i) {
    points.emplace_back(share(rng), share(rng), 1.5 + share(rng));
    pixels.push_back(*lens.project(pose * points.back()));
  }
  const auto found = linear_camera(points, pixels);
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR(found->fx, 1500, 1e-4);
  EXPECT_NEAR(found->fy, 1510, 1e-4);
  EXPECT_NEAR(found->cy, 1280, 1e-4);
  EXPECT_TRUE(pose_near(found->imager_from_world, pose, 1e-7, 1e-7));
  for (Vector3d& p : points) p.z() = 1.5 + 0.2 * p.x();  // now all on a plane
  pixels.clear();
  for (const Vector3d& p : points) pixels.push_back(*lens.project(pose * p));
  EXPECT_FALSE(linear_camera(points, pixels).has_value());
}

class PerfectData : public testing::TestWithParam<std::tuple<int, int, double>> {};

TEST_P(PerfectData, GivesTheTruth) {
  const auto [cameras, projectors, shift] = GetParam();
  const World world = make_world(cameras, projectors, 6, shift);
  const auto solution = solve(world.observations, without_priors());
  ASSERT_TRUE(solution.ok()) << solution.message();
  for (size_t i = 0; i < world.rig.cameras.size(); ++i) {
    expect_same_lens(solution->rig.cameras[i], world.rig.cameras[i], 1e-4, 1e-6);
    EXPECT_TRUE(pose_near(solution->rig.cameras[i].imager_from_world, world.rig.cameras[i].imager_from_world,
                          1e-6, 1e-6));
  }
  for (size_t i = 0; i < world.rig.projectors.size(); ++i) {
    expect_same_lens(solution->rig.projectors[i], world.rig.projectors[i], 1e-4, 1e-6);
    EXPECT_TRUE(pose_near(solution->rig.projectors[i].imager_from_world,
                          world.rig.projectors[i].imager_from_world, 1e-6, 1e-6));
  }
  EXPECT_TRUE(near(solution->bend_m, world.bend, 1e-8));
  for (const Vector2d& r : solution->match_residuals) ASSERT_LT(r.norm(), 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Solve,
                         PerfectData,
                         testing::Values(std::tuple(1, 1, 0.0),
                                         std::tuple(1, 1, 0.5),
                                         std::tuple(1, 1, 1.1),
                                         std::tuple(2, 2, 0.5)));

TEST(Solve, FindsTheNoiseThatWasPutIn) {
  World world = make_world(1, 1, 8, 0.5);
  add_noise(&world, 0.1, 0.05, test_rng());
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  EXPECT_NEAR(solution->noise.corner.common_px, 0.1, 0.01);
  EXPECT_NEAR(solution->noise.match.common_px, 0.05, 0.005);
  double squared = 0;
  for (const Vector2d& r : solution->match_residuals) squared += r.squaredNorm();
  EXPECT_NEAR(std::sqrt(squared / (2.0 * static_cast<double>(solution->match_residuals.size()))), 0.05,
              0.003);
}

// Tests where light lands, not single values, because those are correlated. Weak priors must have no effect
// either.
TEST(Solve, NoisyShiftedProjectorLandsWithinATenthOfAPixel) {
  World world = make_world(1, 1, 10, 1.1);
  const Observations clean = world.observations;
  add_noise(&world, 0.1, 0.1, test_rng());
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  double squared = 0;
  for (const Match& match : clean.matches) {
    const auto& pose = solution->world_from_board[static_cast<size_t>(match.pose)];
    const auto px = predicted(clean, *solution, *pose, match);
    ASSERT_TRUE(px.has_value());
    squared += (*px - match.px_projector).squaredNorm();
  }
  EXPECT_LT(std::sqrt(squared / static_cast<double>(clean.matches.size())), 0.05);
}

TEST(Solve, OutliersDoNotMatter) {
  World world = make_world(1, 1, 8, 0.5);
  add_noise(&world, 0.05, 0.05, test_rng());
  const auto clean = solve(world.observations);
  ASSERT_TRUE(clean.ok()) << clean.message();
  int wrong = 0;
  for (size_t i = 0; i < world.observations.matches.size(); i += 25, ++wrong)
    world.observations.matches[i].px_projector += Vector2d(4, -6);
  for (size_t i = 0; i < world.observations.corners.size(); i += 40)
    world.observations.corners[i].px += Vector2d(2, 1.5);
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  EXPECT_TRUE(pose_near(solution->rig.projectors[0].imager_from_world,
                        clean->rig.projectors[0].imager_from_world, 0.05_deg, 1_mm));
  int found = 0;
  for (size_t i = 0; i < world.observations.matches.size(); i += 25)
    found += solution->match_outlier[i] ? 1 : 0;
  EXPECT_EQ(found, wrong);
}

TEST(Solve, IsTheSameEveryTime) {
  World world = make_world(1, 2, 6, 0.5);
  add_noise(&world, 0.1, 0.1, test_rng());
  const auto a = solve(world.observations), b = solve(world.observations);
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_EQ(a->rig.projectors[1].lens.values, b->rig.projectors[1].lens.values);
  EXPECT_EQ(a->rig.cameras[0].lens.values, b->rig.cameras[0].lens.values);
}

TEST(Solve, UsesAPoseOfWhichFewCornersAreSeen) {
  World world = make_world(1, 1, 6, 0.5);
  std::erase_if(world.observations.corners,
                [](const CornerObservation& c) { return c.pose == 4 && c.corner % 17 != 0; });
  const auto solution = solve(world.observations, without_priors());
  ASSERT_TRUE(solution.ok()) << solution.message();
  ASSERT_TRUE(solution->world_from_board[4].has_value());
  EXPECT_TRUE(pose_near(*solution->world_from_board[4], world.world_from_board[4], 1e-5, 1e-5));
}

TEST(Solve, SaysWhatIsMissing) {
  World world = make_world(1, 1, 6, 0.5);
  Observations dark = world.observations;
  dark.matches.clear();
  EXPECT_NE(solve(dark).message().find("projector0"), std::string::npos);
  Observations blind = world.observations;
  blind.corners.clear();
  EXPECT_NE(solve(blind).message().find("camera0"), std::string::npos);
  Observations few = without_pose(without_pose(without_pose(without_pose(world.observations, 0), 1), 2), 3);
  EXPECT_NE(solve(few).message().find("at least 3 poses, found it in 2"), std::string::npos)
      << solve(few).message();
  SolveOptions options;
  options.projector_model = "LENSMODEL_CAHVOR";
  EXPECT_NE(solve(world.observations, options).message().find("LENSMODEL_CAHVOR"), std::string::npos);

  World apart = make_world(2, 1, 6, 0.5);
  std::erase_if(apart.observations.corners,
                [](const CornerObservation& c) { return (c.camera == 0) == (c.pose < 3); });
  std::erase_if(apart.observations.matches, [](const Match& m) { return m.camera == 1 || m.pose < 3; });
  EXPECT_NE(solve(apart.observations).message().find("camera1"), std::string::npos);
}

TEST(Solve, NotANumberIsAnErrorNotACrash) {
  World world = make_world(1, 1, 6, 0.5);
  world.observations.matches[3].px_projector.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(solve(world.observations).ok());
}

TEST(Assess, HeldOutErrorIsTheNoiseOfTheCells) {
  World world = make_world(1, 1, 8, 0.5);
  add_noise(&world, 0.05, 0.1, test_rng());
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  const auto score = cross_validate(world.observations, {}, *solution);
  ASSERT_TRUE(score.ok()) << score.message();
  EXPECT_EQ(score->poses.size(), 8U);
  EXPECT_GT(score->rms_px, 0.1 * std::sqrt(2.0) * 0.97);  // RMS of the 2-vector
  EXPECT_LT(score->rms_px, 0.1 * std::sqrt(2.0) * 1.15);
  // 0.1 px at 1600 px focal length and 1.1 m are 0.07 mm; 95 % of a Rayleigh distribution is 2.45 times that,
  // 0.18 mm. This noise of single matches is no error of the rig, which is smaller.
  Observed observed{world.observations, {{0, 0, 0, 1000, 900, 2}}, {}, 0, 0};
  const auto assessment = assess(observed, {}, *solution);
  ASSERT_TRUE(assessment.ok()) << assessment.message();
  EXPECT_GT(assessment->predicted_error_mm[0], 0.04);
  EXPECT_LT(assessment->predicted_error_mm[0], 0.14);
  EXPECT_EQ(assessment->verdict, Verdict::good);
  EXPECT_DOUBLE_EQ(assessment->decoded_share, 0.9);
}

// Errors of camera 0's values, projector 0's values and its pose, in the covariance's order.
Eigen::VectorXd device_errors(const Solution& solution, const World& world) {
  std::vector<double> errors;
  const auto take = [&](const Imager& found, const Imager& truth) {
    for (size_t i = 0; i < truth.lens.values.size(); ++i)
      errors.push_back(found.lens.values[i] - truth.lens.values[i]);
    const Vector6d pose = boxminus(found.imager_from_world, truth.imager_from_world);
    errors.insert(errors.end(), pose.begin(), pose.end());
  };
  take(solution.rig.cameras[0], world.rig.cameras[0]);
  take(solution.rig.projectors[0], world.rig.projectors[0]);
  return Eigen::Map<Eigen::VectorXd>(errors.data(), static_cast<Eigen::Index>(errors.size()));
}

// Squared errors in units of their covariance are chi-squared, with one degree of freedom for each parameter.
TEST(Solve, ErrorsScatterAsTheCovarianceSays) {
  const World clean = make_world(1, 1, 6, 0.5);
  std::mt19937_64 rng = test_rng();
  double squared = 0;
  constexpr int k_draws = 15, k_unknowns = 8 + 8 + 6;
  for (int draw = 0; draw < k_draws; ++draw) {
    World world = clean;
    add_noise(&world, 0.1, 0.05, std::mt19937_64(rng()));
    SolveOptions options = without_priors();
    options.robust_at = 10;
    const auto solution = solve(world.observations, options);
    ASSERT_TRUE(solution.ok()) << solution.message();
    const Eigen::VectorXd errors = device_errors(*solution, clean);
    ASSERT_EQ(solution->covariance.rows(), errors.size());
    // Camera 0's pose is fixed: those six rows are zero, and so are its errors.
    std::vector<int> free;
    for (int i = 0; i < errors.size(); ++i) {
      if (i < 8 || i >= 14) free.push_back(i);
    }
    const Eigen::VectorXd e = errors(free);
    const Eigen::MatrixXd c = solution->covariance(free, free);
    const Eigen::VectorXd scale = c.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd correlation = scale.asDiagonal() * c * scale.asDiagonal();
    const Eigen::VectorXd pulls = scale.asDiagonal() * e;
    squared += pulls.dot(correlation.ldlt().solve(pulls)) / (k_draws * k_unknowns);
  }
  // 330 degrees of freedom: one standard deviation is 0.08.
  EXPECT_NEAR(squared, 1.0, 0.25);
}

TEST(Assess, ParallelBoardsInTheMiddleAreNeverGood) {
  World healthy = make_world(1, 1, 8, 0.5), parallel = healthy;
  parallel.observations.corners.clear();
  parallel.observations.matches.clear();
  for (int pose = 0; pose < 8; ++pose) {
    auto& board = parallel.world_from_board[static_cast<size_t>(pose)];
    const double tilt = 0.04 * (pose % 3);  // at most 5 degrees
    board = Pose(exp_rotation({tilt, 0.03 * (pose % 2), 0}),
                 Vector3d(-0.1375 + 0.01 * (pose % 3), -0.1 + 0.008 * (pose % 4), 1.1 + 0.005 * pose));
    observe_corners(&parallel, 0, pose);
    observe_matches(&parallel, 0, 0, pose);
  }
  std::vector<double> propagated;
  for (World* world : {&healthy, &parallel}) {
    add_noise(world, 0.05, 0.05, test_rng());
    const auto solution = solve(world->observations);
    ASSERT_TRUE(solution.ok()) << solution.message();
    const auto assessment = assess({world->observations, {}, {}, 0, 0}, {}, *solution);
    ASSERT_TRUE(assessment.ok()) << assessment.message();
    propagated.push_back(assessment->propagated_error_mm[0]);
    EXPECT_EQ(assessment->verdict == Verdict::good, world == &healthy);
  }
  EXPECT_LT(propagated[0], 0.3);
  EXPECT_GT(propagated[1], 1.5 * propagated[0]);  // measuring the target itself costs both the same
  printf("[ ill-posed] propagated %.3f mm healthy, %.3f mm parallel\n", propagated[0], propagated[1]);
}

TEST(Assess, NoticesABoardThatMovedWhileItWasCaptured) {
  World world = make_world(1, 1, 8, 0.5);
  add_noise(&world, 0.05, 0.05, test_rng());
  for (Match& match : world.observations.matches) {
    if (match.pose == 3) match.px_projector += Vector2d(5, 3);
  }
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  const auto assessment = assess({world.observations, {}, {}, 0, 0}, {}, *solution);
  ASSERT_TRUE(assessment.ok()) << assessment.message();
  EXPECT_NE(assessment->verdict, Verdict::good);
  bool named = false;
  for (const Fault& fault : assessment->faults)
    named = named || (fault.name == FaultName::odd_pose && fault.poses.front() == "pose3" &&
                      fault.evidence.find("pose3") != std::string::npos);
  EXPECT_TRUE(named);
}

TEST(Assess, LeavesOutABoardWhoseCornersAreOnALine) {
  World world = make_world(1, 1, 6, 0.5);
  add_noise(&world, 0.05, 0.05, test_rng());
  std::erase_if(world.observations.corners,
                [](const CornerObservation& c) { return c.pose == 4 && c.corner >= 5; });
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  const auto assessment = assess({world.observations, {}, {}, 0, 0}, {}, *solution);
  ASSERT_TRUE(assessment.ok()) << assessment.message();
  EXPECT_EQ(assessment->held_out.poses.size(), 5U);
  ASSERT_FALSE(assessment->faults.empty());
  EXPECT_EQ(assessment->faults[0].name, FaultName::board_not_placed);
  EXPECT_EQ(assessment->verdict, Verdict::good);
}

TEST(Assess, NoticesPosesWithoutABoard) {
  World world = make_world(1, 1, 6, 0.5);
  add_noise(&world, 0.05, 0.05, test_rng());
  world.observations = without_pose(world.observations, 2);
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  const auto assessment = assess({world.observations, {}, {}, 0, 0}, {}, *solution);
  ASSERT_TRUE(assessment.ok()) << assessment.message();
  ASSERT_FALSE(assessment->faults.empty());
  EXPECT_EQ(assessment->faults[0].name, FaultName::board_not_visible);
  EXPECT_NE(assessment->faults[0].evidence.find("pose2"), std::string::npos);
}

}  // namespace
}  // namespace limn::calib
