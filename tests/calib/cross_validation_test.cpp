#include "calib/cross_validation.h"

#include <gtest/gtest.h>

#include "calib/model_selection.h"
#include "tests/calib/observed_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;
using namespace limn::calib::worlds;
using Eigen::Vector2d;

// One minimisation with the full solution's noise is compared with all rounds with their own noise.
TEST(CrossValidation, IsWhatASolveFromScratchWithoutThePoseForetells) {
  World world = make_world(1, 1, 6, 0.5);
  add_noise(&world, 0.08, 0.1, test_rng());
  for (size_t i = 0; i < world.observations.matches.size(); i += 60)
    world.observations.matches[i].px_projector += Vector2d(3, -2);
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  const auto score = cross_validate(world.observations, {}, *solution);
  ASSERT_TRUE(score.ok()) << score.message();
  double worst = 0;
  for (int pose = 0; pose < 6; ++pose) {
    const auto scratch = solve(without_pose(world.observations, pose));
    ASSERT_TRUE(scratch.ok()) << scratch.message();
    const auto board = board_pose_from_cameras(world.observations, *scratch, pose);
    ASSERT_TRUE(board.ok()) << board.message();
    for (size_t i = 0; i < world.observations.matches.size(); ++i) {
      const Match& match = world.observations.matches[i];
      if (match.pose != pose) continue;
      const Vector2d residual = *predicted(world.observations, *scratch, *board, match) - match.px_projector;
      worst = std::max(worst, (residual - score->residuals[i]).norm());
    }
  }
  EXPECT_LT(worst, 0.01);  // a tenth of the noise of one match
  EXPECT_GT(worst, 0) << "the two computations are not identical";
}

TEST(CrossValidation, LeavesThePoseOut) {
  World world = make_world(1, 1, 6, 0.5);
  add_noise(&world, 0.05, 0.05, test_rng());
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  Observations wrong = world.observations;  // the projector pixels of pose 2 must not influence its solve
  for (Match& match : wrong.matches) match.px_projector += Vector2d(match.pose == 2 ? 7 : 0, 0);
  const auto a = cross_validate(world.observations, {}, *solution), b = cross_validate(wrong, {}, *solution);
  ASSERT_TRUE(a.ok() && b.ok());
  for (size_t i = 0; i < wrong.matches.size(); ++i) {
    if (wrong.matches[i].pose != 2) continue;
    ASSERT_TRUE(near(b->residuals[i] - a->residuals[i], Vector2d(-7, 0), 1e-9));
  }
}

std::string chosen(const ModelSelection& choice, const std::string& device) {
  for (const ModelTrial& trial : choice.trials) {
    if (trial.device == device && trial.chosen) return trial.model;
  }
  return "none";
}

SolveOptions any_lens() {
  SolveOptions options;
  options.camera_model = options.projector_model = k_auto_lens;
  return options;
}

TEST(LensChoice, TakesWhatTheLensesNeedAndNoMore) {
  WorldOptions plain;
  plain.poses = 6;
  plain.projector_distortion = {};
  World pinhole = make_world(plain);
  add_noise(&pinhole, 0.05, 0.05, test_rng());
  const auto a = solve_selecting_models(pinhole.observations, any_lens());
  ASSERT_TRUE(a.ok()) << a.message();
  EXPECT_EQ(chosen(*a, "camera0"), "LENSMODEL_OPENCV4");
  EXPECT_EQ(chosen(*a, "projector0"), "LENSMODEL_PINHOLE");
  EXPECT_EQ(a->solution.rig.projectors[0].lens.model.name(), "LENSMODEL_PINHOLE");
  EXPECT_GE(a->trials.size(), 4U);

  WorldOptions wild = plain;  // strong radial terms that a polynomial of fourth degree cannot follow
  wild.projector_distortion = {-0.15, 0.1, 0.0004, 0.0003, -1.5};
  World rich = make_world(wild);
  add_noise(&rich, 0.05, 0.02, test_rng());
  const auto b = solve_selecting_models(rich.observations, any_lens());
  ASSERT_TRUE(b.ok()) << b.message();
  for (const ModelTrial& t : b->trials)
    printf("[ trial    ] %s %s held-out %.4f px, gain %.3f +- %.3f\n", t.device.c_str(), t.model.c_str(),
           t.held_out_px, t.gain, t.uncertainty);
  EXPECT_TRUE(chosen(*b, "projector0") == "LENSMODEL_OPENCV5" ||
              chosen(*b, "projector0") == "LENSMODEL_OPENCV8")
      << chosen(*b, "projector0");
  EXPECT_EQ(b->solution.rig.projectors[0].lens.model.name(), chosen(*b, "projector0"));
  EXPECT_GT(b->solution.covariance.rows(), 0);
}

TEST(LensChoice, GivesEveryDeviceOfALargerRigItsOwn) {
  World world = make_world(2, 2, 6, 0.5);
  add_noise(&world, 0.05, 0.05, test_rng());
  SolveOptions options = any_lens();
  options.lens_models = {"LENSMODEL_OPENCV4", "LENSMODEL_OPENCV5", "auto", "LENSMODEL_OPENCV4"};
  const auto choice = solve_selecting_models(world.observations, options);
  ASSERT_TRUE(choice.ok()) << choice.message();
  EXPECT_EQ(choice->solution.rig.cameras[1].lens.model.name(), "LENSMODEL_OPENCV5");
  EXPECT_EQ(chosen(*choice, "projector0"), "LENSMODEL_OPENCV4");
  EXPECT_EQ(chosen(*choice, "projector1"), "none") << "it was given";
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_TRUE(pose_near(choice->solution.rig.projectors[i].imager_from_world,
                          world.rig.projectors[i].imager_from_world, 0.1_deg, 2_mm));
    EXPECT_TRUE(pose_near(choice->solution.rig.cameras[i].imager_from_world,
                          world.rig.cameras[i].imager_from_world, 0.1_deg, 2_mm));
  }
}

}  // namespace
}  // namespace limn::calib
