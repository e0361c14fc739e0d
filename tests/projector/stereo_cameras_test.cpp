// Two cameras of a rig as the two eyes of a person.
#include "projector/stereo_cameras.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace limn::projector {
namespace {

Imager camera(const char* name, const Eigen::Vector3d& eye, const Eigen::Vector3d& target, double turn = 0) {
  Imager out{name, 640, 480, Lens(), {}};
  out.lens = Lens::create("LENSMODEL_OPENCV4", {610, 612, 322, 236, -0.12, 0.05, 1e-3, -1e-3}).value();
  const Pose rolled(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
                    Eigen::Vector3d::Zero());
  out.imager_from_world = rolled * looking_at(eye, target, {0, 0, 1});
  return out;
}

// Two cameras 120 mm apart, 1.2 m before a target; the right one is higher and rolled a little.
Rig two_cameras() {
  Rig rig;
  rig.cameras = {camera("right", {0.06, -1.2, 0.52}, {0, 0, 0.5}, 0.05),
                 camera("left", {-0.06, -1.2, 0.5}, {0, 0, 0.5})};
  return rig;
}

TEST(StereoCamerasOfARig, AreTheLeftAndTheRightEye) {
  const auto pair = StereoCameras::chosen(two_cameras());
  ASSERT_TRUE(pair);
  EXPECT_EQ(pair->cameras(), (std::array<std::size_t, 2>{1, 0}));
}

TEST(StereoCamerasOfARig, AreTheTwoWithTheShortestBaseLine) {
  Rig rig = two_cameras();
  rig.cameras.push_back(camera("far", {1.1, -0.8, 0.5}, {0, 0, 0.5}));
  rig.cameras.push_back(camera("near", {0.0, -1.2, 0.5}, {0, 0, 0.5}));
  const auto pair = StereoCameras::chosen(rig);
  ASSERT_TRUE(pair);
  EXPECT_EQ(pair->cameras(), (std::array<std::size_t, 2>{1, 3}));
}

TEST(StereoCamerasOfARig, AreNoneWhereAPersonCouldNotLookAtBoth) {
  Rig one = two_cameras();
  one.cameras.pop_back();
  EXPECT_FALSE(StereoCameras::chosen(one)) << "one camera";
  Rig above = two_cameras();
  above.cameras[0] = camera("above", {-0.06, -1.2, 0.62}, {0, 0, 0.5});
  EXPECT_FALSE(StereoCameras::chosen(above)) << "one above the other";
  Rig around = two_cameras();
  around.cameras[0] = camera("around", {1.1, -0.5, 0.5}, {0, 0, 0.5});
  EXPECT_FALSE(StereoCameras::chosen(around)) << "on two sides of the prototype";
  Rig upside_down = two_cameras();
  upside_down.cameras[0] = camera("right", {0.06, -1.2, 0.5}, {0, 0, 0.5}, 3.1);
  EXPECT_FALSE(StereoCameras::chosen(upside_down));
}

TEST(RectifiedEyes, SeeAPointInOneRowAndInTheScreensPlaneInOneColumn) {
  const auto pair = StereoCameras::chosen(two_cameras());
  ASSERT_TRUE(pair);
  const auto& [left, right] = pair->eyes();
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.1, 0.2, 0.4), Eigen::Vector3d(-0.3, -0.4, 0.7)}) {
    const Eigen::Vector2d a = left.project(p).value(), b = right.project(p).value();
    EXPECT_NEAR(a.y(), b.y(), 1e-9);
    // A nearer point is further left in the right eye's image.
    EXPECT_EQ(a.x() > b.x(), p.y() < 0) << a.x() - b.x();
  }
  const Eigen::Vector3d target(0, 0, 0.5);
  EXPECT_NEAR(left.project(target)->x(), right.project(target)->x(), 1.5);
}

// The camera's image of a dot, rectified, has the dot where the eye sees the point.
TEST(RectifiedEyes, GetTheImagesThatTheCamerasTook) {
  const Rig rig = two_cameras();
  const auto pair = StereoCameras::chosen(rig);
  ASSERT_TRUE(pair);
  const Eigen::Vector3d p(0.08, 0.1, 0.62);
  std::array<cv::Mat, 2> photos;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    photos[eye] = cv::Mat(480, 640, CV_8UC1, cv::Scalar(0));
    const Eigen::Vector2d px = rig.cameras[pair->cameras()[eye]].project(p).value();
    cv::circle(
        photos[eye],
        cv::Point(static_cast<int>(std::lround(16 * px.x())), static_cast<int>(std::lround(16 * px.y()))),
        16 * 6, cv::Scalar(255), cv::FILLED, cv::LINE_AA, 4);
  }
  const EyeImages images = pair->rectified({photos[0], photos[1]});
  for (std::size_t eye = 0; eye < 2; ++eye) {
    const cv::Moments m = cv::moments(eye == 0 ? images.left : images.right);
    ASSERT_GT(m.m00, 0);
    const Eigen::Vector2d expected = pair->eyes()[eye].project(p).value();
    EXPECT_NEAR(m.m10 / m.m00, expected.x(), 0.1);
    EXPECT_NEAR(m.m01 / m.m00, expected.y(), 0.1);
  }
}

}  // namespace
}  // namespace limn::projector
