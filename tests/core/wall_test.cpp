// A wall is a window: what an eye sees through a pixel lies on the line from the eye through that pixel.
#include "core/wall.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>

#include "tests/support/matchers.h"

namespace limn {
namespace {

const cv::Size k_pixels(400, 300);

// A wall of 2 x 1.2 m that stands upright, seen from the side of negative y.
Wall wall() { return {{-0.7, 0.5, 1.5}, {1.3, 0.5, 1.5}, {-0.7, 0.5, 0.3}}; }

Eigen::Vector3d on_wall(const Wall& wall, const Eigen::Vector2d& px) {
  return wall.top_left + (px.x() + 0.5) / k_pixels.width * (wall.top_right - wall.top_left) +
         (px.y() + 0.5) / k_pixels.height * (wall.bottom_left - wall.top_left);
}

TEST(AWall, ShowsEachPointWhereTheEyeSeesItOnTheWall) {
  const Wall wall = limn::wall();
  for (const Eigen::Vector3d& eye :
       {Eigen::Vector3d(0.3, -1, 0.9), Eigen::Vector3d(-2.5, -0.3, 1.7), Eigen::Vector3d(1.2, 0.45, 0.2)}) {
    const auto imager = seen_through(wall, eye, k_pixels);
    ASSERT_TRUE(imager);
    for (const Eigen::Vector2d& px :
         {Eigen::Vector2d(0, 0), Eigen::Vector2d(399, 12.5), Eigen::Vector2d(37.25, 299)})
      for (const double times : {0.4, 1.0, 3.0}) {  // before, on and behind the wall
        const Eigen::Vector3d p = eye + times * (on_wall(wall, px) - eye);
        const auto seen = imager->project(p);
        ASSERT_TRUE(seen);
        EXPECT_LT((*seen - px).norm(), 1e-9) << "eye " << eye.transpose() << ", pixel " << px.transpose();
      }
  }
}

TEST(AWall, MayLeanInAnyDirection) {
  const Pose leaning(Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, 2, -0.5).normalized()).toRotationMatrix(),
                     {0.2, -3, 1});
  Wall wall = limn::wall();
  const Eigen::Vector3d eye = leaning * Eigen::Vector3d(0.1, -1.4, 1);
  for (Eigen::Vector3d* corner : {&wall.top_left, &wall.top_right, &wall.bottom_left})
    *corner = leaning * *corner;
  const auto imager = seen_through(wall, eye, k_pixels);
  ASSERT_TRUE(imager);
  const Eigen::Vector2d px(250, 40);
  EXPECT_LT((imager->project(on_wall(wall, px)).value() - px).norm(), 1e-9);
}

TEST(AWall, ShowsNothingToAnEyeBehindIt) {
  EXPECT_FALSE(seen_through(wall(), {0, 0.6, 1}, k_pixels));
  EXPECT_FALSE(seen_through(wall(), {0, 0.495, 1}, k_pixels)) << "5 mm before it";
  EXPECT_TRUE(seen_through(wall(), {0, 0.48, 1}, k_pixels));
}

TEST(AWall, ThatIsNoRectangleIsRefused) {
  EXPECT_TRUE(check_wall(wall()));
  Wall skew = wall();
  skew.bottom_left.x() += 0.1;
  const Status status = check_wall(skew);
  ASSERT_FALSE(status);
  EXPECT_NE(status.message().find("85.2 degrees"), std::string::npos) << status.message();
  Wall flat = wall();
  flat.top_right = flat.top_left;
  EXPECT_NE(check_wall(flat).message().find("top side"), std::string::npos);
  flat = wall();
  flat.bottom_left.z() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(check_wall(flat).message().find("left side"), std::string::npos);
}

}  // namespace
}  // namespace limn
