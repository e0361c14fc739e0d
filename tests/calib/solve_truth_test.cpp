// The bundle adjustment in worlds with known truth: where light lands on boards that no solve has used.
#include <gtest/gtest.h>

#include <cmath>

#include "calib/cross_validation.h"
#include "calib/solve.h"
#include "tests/calib/observed_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;
using namespace limn::calib::worlds;
using Eigen::Vector2d;

// Flat boards at other poses in front of the same devices, observed without noise.
World unseen_boards(const World& world, int poses, double distance_m) {
  World unseen;
  unseen.rig = world.rig;
  unseen.bend.setZero();
  unseen.shape = world.shape;
  unseen.observations.board = world.observations.board;
  unseen.observations.cameras = world.observations.cameras;
  unseen.observations.projectors = world.observations.projectors;
  std::mt19937_64 rng(11);
  for (int pose = 0; pose < poses; ++pose) {
    unseen.world_from_board.push_back(board_place(pose + 100, unseen.shape, distance_m, &rng));
    unseen.observations.poses.push_back("unseen" + std::to_string(pose));
    observe_corners(&unseen, 0, pose);
    for (size_t k = 0; k < world.rig.projectors.size(); ++k)
      observe_matches(&unseen, 0, static_cast<int>(k), pose);
  }
  return unseen;
}

// Errors of the projectors' pixels there; the pose of a board is measured with the solved camera.
std::vector<Vector2d> errors_on(const World& unseen, Solution solution) {
  solution.bend_m.setZero();  // the bend belongs to the calibration's board; these are flat
  std::vector<Vector2d> errors;
  for (int pose = 0; pose < static_cast<int>(unseen.world_from_board.size()); ++pose) {
    const Pose board = board_pose_from_cameras(unseen.observations, solution, pose).value();
    for (const Match& match : unseen.observations.matches) {
      if (match.pose == pose)
        errors.push_back(*predicted(unseen.observations, solution, board, match) - match.px_projector);
    }
  }
  return errors;
}

double rms(const std::vector<Vector2d>& errors) {
  double squared = 0;
  for (const Vector2d& e : errors) squared += e.squaredNorm();
  return std::sqrt(squared / static_cast<double>(errors.size()));
}

// RMS over draws of noise, with or without the tie points.
double error_over_draws(const World& world, const World& unseen, bool with_points, int draws) {
  std::mt19937_64 rng = test_rng();
  double squared = 0;
  for (int draw = 0; draw < draws; ++draw) {
    World noisy = world;
    add_noise(&noisy, 0.1, 0.1, std::mt19937_64(rng()));
    if (!with_points) {
      noisy.observations.points.clear();
      noisy.observations.tie_observations.clear();
    }
    const auto solution = solve(noisy.observations);
    EXPECT_TRUE(solution.ok()) << solution.message();
    if (!solution) return std::nan("");
    squared += std::pow(rms(errors_on(unseen, *solution)), 2) / draws;
  }
  return std::sqrt(squared);
}

TEST(FreePoints, HelpAWeakSetAndDoNoHarmToAHealthyOne) {
  WorldOptions few;
  few.projectors = 2;
  few.poses = 3;
  WorldOptions many = few;
  many.poses = 8;
  constexpr int k_draws = 6;
  double without[2], with[2];
  for (const int healthy : {0, 1}) {
    World world = make_world(healthy ? many : few);
    observe_scene(&world, 20, 16);
    const World unseen = unseen_boards(world, 4, 1.1);
    ASSERT_GT(world.observations.points.size(), 100U);
    without[healthy] = error_over_draws(world, unseen, false, k_draws);
    with[healthy] = error_over_draws(world, unseen, true, k_draws);
    printf("[ points   ] %s: unseen boards %.4f px without, %.4f px with %zu tie points\n",
           healthy ? "8 poses" : "3 poses", without[healthy], with[healthy],
           world.observations.points.size());
  }
  EXPECT_LT(with[0], 0.9 * without[0]);
  EXPECT_LT(with[1], 1.05 * without[1]);  // six draws: 2 % are chance
}

TEST(FreePoints, PerfectOnesAreFoundWhereTheyAreAndWrongOnesDoNotMatter) {
  World world = make_world(2, 2, 4, 0.5);
  observe_scene(&world, 12, 10);
  Observations& o = world.observations;
  for (size_t i = 0; i < o.tie_observations.size(); i += 17) o.tie_observations[i].px += Vector2d(6, 9);
  const auto solution = solve(o);
  ASSERT_TRUE(solution.ok()) << solution.message();
  EXPECT_TRUE(pose_near(solution->rig.projectors[1].imager_from_world,
                        world.rig.projectors[1].imager_from_world, 0.01_deg, 0.2_mm));
  EXPECT_TRUE(pose_near(solution->rig.cameras[1].imager_from_world, world.rig.cameras[1].imager_from_world,
                        0.01_deg, 0.2_mm));
  size_t placed = 0;
  for (const auto& p : solution->points) placed += p ? 1 : 0;
  EXPECT_EQ(placed, o.points.size());
  EXPECT_GT(solution->tie_point_residuals[0].norm(), 1);
  EXPECT_LT(solution->tie_point_residuals[5].norm(), 0.02);
}

TEST(Bend, ABowIsFoundAndCostsNothing) {
  WorldOptions flat, bowed;
  flat.bend.setZero();
  flat.poses = bowed.poses = 8;
  bowed.bend = {0.0004, 0};
  double error[2];
  Vector2d found = Vector2d::Zero();
  constexpr int k_draws = 4;
  for (const int is_bowed : {0, 1}) {
    const World world = make_world(is_bowed ? bowed : flat);
    const World unseen = unseen_boards(world, 4, 1.1);
    std::mt19937_64 rng = test_rng();
    double squared = 0;
    for (int draw = 0; draw < k_draws; ++draw) {
      World noisy = world;
      add_noise(&noisy, 0.1, 0.1, std::mt19937_64(rng()));
      const auto solution = solve(noisy.observations);
      ASSERT_TRUE(solution.ok()) << solution.message();
      if (is_bowed) found += solution->bend_m / k_draws;
      squared += std::pow(rms(errors_on(unseen, *solution)), 2) / k_draws;
    }
    error[is_bowed] = std::sqrt(squared);
  }
  printf(
      "[ bend     ] bow of 0.4 mm found as %.3f and %.3f mm; unseen flat boards %.4f px, %.4f px after a "
      "flat "
      "one\n",
      1e3 * found.x(), 1e3 * found.y(), error[1], error[0]);
  EXPECT_TRUE(near(found, bowed.bend, 0.03e-3));
  EXPECT_LT(error[1], 1.1 * error[0]);
}

// The mean over draws of where light lands depends on the prior alone.
TEST(Priors, DoNotBiasALensShiftedProjector) {
  WorldOptions options;
  options.shift = 1.1;
  options.poses = 8;
  const World world = make_world(options);
  const World unseen = unseen_boards(world, 3, 1.4);
  std::mt19937_64 rng = test_rng();
  constexpr int k_draws = 30;  // docs/measurements.md: 3.1 px (mrcal's prior) and 0.5 px
  std::vector<Vector2d> mean;
  double scatter = 0;
  for (int draw = 0; draw < k_draws; ++draw) {
    World noisy = world;
    add_noise(&noisy, 0.1, 0.1, std::mt19937_64(rng()));
    const auto solution = solve(noisy.observations);
    ASSERT_TRUE(solution.ok()) << solution.message();
    const std::vector<Vector2d> errors = errors_on(unseen, *solution);
    mean.resize(errors.size(), Vector2d::Zero());
    for (size_t i = 0; i < errors.size(); ++i) mean[i] += errors[i] / k_draws;
    scatter += std::pow(rms(errors), 2) / k_draws;
  }
  double worst = 0;
  for (const Vector2d& bias : mean) worst = std::max(worst, bias.norm());
  printf("[ prior    ] bias at 1.4 m %.4f px RMS, %.4f px worst; one draw %.4f px RMS\n", rms(mean), worst,
         std::sqrt(scatter));
  EXPECT_LT(worst, 0.3);
}

TEST(Solve, ContradictionsEndInAMessageOrInFiniteNumbers) {
  World world = make_world(1, 1, 5, 0.5);
  std::mt19937_64 rng = test_rng();
  std::uniform_real_distribution<double> anywhere(0, 1000);
  int failed = 0;
  for (int kind = 0; kind < 4; ++kind) {
    Observations wrong = world.observations;
    for (Match& match : wrong.matches) {
      if (kind == 0) match.px_projector = Vector2d(anywhere(rng), anywhere(rng));
      if (kind == 1 && match.pose % 2 == 1) match.px_projector.x() = 1279 - match.px_projector.x();
      if (kind == 2) match.px_projector = Vector2d(640, 400);
    }
    for (CornerObservation& seen : wrong.corners) {
      if (kind == 3) seen.px = Vector2d(anywhere(rng), anywhere(rng));
    }
    const auto solution = solve(wrong);
    if (!solution) {
      EXPECT_GT(solution.message().size(), 30U);
      ++failed;
      continue;
    }
    for (const Imager* imager : {&solution->rig.cameras[0], &solution->rig.projectors[0]}) {
      for (const double v : imager->lens.values) EXPECT_TRUE(std::isfinite(v)) << kind;
      EXPECT_TRUE(imager->imager_from_world.is_finite()) << kind;
    }
    EXPECT_TRUE(solution->covariance.allFinite()) << kind;
    const auto score = cross_validate(wrong, {}, *solution);
    EXPECT_TRUE(!score || score->rms_px > 10) << kind;
  }
  printf("[ wrong    ] %d of 4 contradictions end in a message\n", failed);
}

}  // namespace
}  // namespace limn::calib
