#include "tracker/local_undistortion.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/matchers.h"

namespace limn::tracker {
namespace {

Lens barrel() {
  return Lens::create("LENSMODEL_OPENCV8", {900, 920, 640, 480, -0.25, 0.08, 1e-3, -1e-3, 0, 0, 0, 0})
      .value();
}

TEST(LocalUndistortion, ShowsStraightThingsStraightAndTheMiddleAsItIs) {
  const Lens lens = barrel();
  constexpr double k_radius_px = 100;
  for (const Eigen::Vector2d& middle :
       {Eigen::Vector2d(640, 480), Eigen::Vector2d(250, 200), Eigen::Vector2d(1100, 800)}) {
    const LocalUndistortion image(lens, middle, k_radius_px);
    ASSERT_TRUE(image.moves());
    EXPECT_TRUE(test::near(image.straight(middle), middle, 1e-9));
    EXPECT_TRUE(
        test::near(image.straight(middle + Eigen::Vector2d(1, 2)), middle + Eigen::Vector2d(1, 2), 0.01));
    const Eigen::Vector3d from = *lens.unproject(middle + Eigen::Vector2d(-90, 60));
    const Eigen::Vector3d to = *lens.unproject(middle + Eigen::Vector2d(80, 95));
    const Eigen::Vector2d a = image.straight(*lens.project(from));
    const Eigen::Vector2d b = image.straight(*lens.project(to));
    const Eigen::Vector2d across = Eigen::Vector2d(a.y() - b.y(), b.x() - a.x()).normalized();
    for (double share = 0.1; share < 1; share += 0.1) {
      const Eigen::Vector2d px = *lens.project((1 - share) * from + share * to);
      EXPECT_NEAR(across.dot(image.straight(px) - a), 0, 0.01) << middle.transpose();
      EXPECT_TRUE(test::near(image.bent(image.straight(px)), px, 1e-3));
    }
  }
}

TEST(LocalUndistortion, MovesNothingWithoutALensOrBesideItsModel) {
  EXPECT_TRUE(test::near(LocalUndistortion().straight({3, 4}), Eigen::Vector2d(3, 4), 0));
  constexpr double k_nan = std::numeric_limits<double>::quiet_NaN();
  const LocalUndistortion beside(barrel(), {k_nan, 100}, 100);
  EXPECT_FALSE(beside.moves());
  EXPECT_TRUE(test::near(beside.bent({3, 4}), Eigen::Vector2d(3, 4), 0));
}

}  // namespace
}  // namespace limn::tracker
