// Compares calib/solve with mrcal_optimize on the same corners.
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "calib/solve.h"
#include "tests/calib/mrcal_solve.h"
#include "tests/calib/observed_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;
using namespace limn::calib::worlds;
using Eigen::Vector2d;

// Least squares as in mrcal: no priors, practically no robust loss, a flat board.
SolveOptions plain_least_squares() {
  constexpr double k_infinite = std::numeric_limits<double>::infinity();
  SolveOptions options;
  options.camera_centre = options.aspect = options.radial = options.tangential = k_infinite;
  options.bend = false;
  options.robust_at = 1e4;
  return options;
}

class Mrcal : public testing::TestWithParam<const char*> {};

TEST_P(Mrcal, AgreesOnTheCameraAndTheBoardPoses) {
  WorldOptions shape;
  shape.bend.setZero();
  shape.projectors = 0;
  if (std::string(GetParam()) == "LENSMODEL_OPENCV5")
    shape.camera_distortion = {-0.12, 0.08, 0.0006, -0.0004, 0.05};
  World world = make_world(shape);
  std::erase_if(world.observations.corners,
                [](const CornerObservation& c) { return (c.corner + c.pose) % 13 == 0; });  // partly covered
  add_noise(&world, 0.1, 0, test_rng());
  SolveOptions options = plain_least_squares();
  options.camera_model = GetParam();
  const auto ours = solve(world.observations, options);
  ASSERT_TRUE(ours.ok()) << ours.message();
  // It starts from the truth, not from our answer, so that the two ways are independent.
  std::map<int, Pose> start;
  for (int pose = 0; pose < 6; ++pose) start[pose] = world.world_from_board[static_cast<size_t>(pose)];
  Imager first = world.rig.cameras[0];
  first.lens = ours->rig.cameras[0].lens;
  std::fill(first.lens.values.begin() + 4, first.lens.values.end(), 0.0);
  const MrcalSolution theirs = mrcal_solve(world.observations, 0, first, start, false);

  double worst = 0, squared = 0;
  for (const CornerObservation& seen : world.observations.corners) {
    const Eigen::Vector3d p = world.observations.board.p_corner(seen.corner);
    const auto a = ours->rig.cameras[0].project(*ours->world_from_board[static_cast<size_t>(seen.pose)] * p);
    const auto b = theirs.camera.lens.project(theirs.camera_from_board.at(seen.pose) * p);
    ASSERT_TRUE(a && b);
    worst = std::max(worst, (*a - *b).norm());
    squared += (*a - seen.px).squaredNorm();
  }
  printf("[ mrcal    ] %s: predictions differ by at most %.6f px; residuals %.4f px RMS\n", GetParam(), worst,
         std::sqrt(squared / static_cast<double>(world.observations.corners.size())));
  EXPECT_LT(worst, 0.002);  // a fiftieth of one corner's noise
  const Eigen::VectorXd stddev = ours->covariance.diagonal().cwiseSqrt();
  for (size_t i = 0; i < theirs.camera.lens.values.size(); ++i) {
    const double difference = ours->rig.cameras[0].lens.values[i] - theirs.camera.lens.values[i];
    EXPECT_LT(std::abs(difference), 0.1 * stddev(static_cast<Eigen::Index>(i))) << "value " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Solve, Mrcal, testing::Values("LENSMODEL_OPENCV4", "LENSMODEL_OPENCV5"));

}  // namespace
}  // namespace limn::calib
