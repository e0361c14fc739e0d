#include "limn/markers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/core.hpp>

#include "library/convert.h"
#include "tests/library/example_inputs.h"
#include "tracker/detector.h"
#include "tracker/marker_pose.h"

namespace limn {
namespace {

namespace api = LIMN_VERSIONED;

api::ImageView view_of(const cv::Mat& grey) {
  return {grey.data, grey.cols, grey.rows, static_cast<std::ptrdiff_t>(grey.step), api::PixelFormat::grey};
}

TEST(LibraryDetector, FindsWhatTheRoomFindsToTheBit) {
  const cv::Mat grey = test::example_image(0);
  const Imager camera = test::example_camera();
  const std::vector<std::string> names = {"apriltag_36h11"};
  tracker::Detector detector(tracker::Families::load(names).value());
  const auto expected = detector.detect(grey, &camera.lens);
  const api::Imager imager = api::to_public(camera);
  const auto found = api::Detector(names).detect(view_of(grey), &imager);
  ASSERT_EQ(expected.size(), 2U);
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].family + ":" + found[i].id, expected[i].marker.text());
    EXPECT_EQ(found[i].score, expected[i].score);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(found[i].corners_px[k], api::to_public(expected[i].corners_px[k]));
      EXPECT_EQ(found[i].corner_covariances[k][1], expected[i].corner_covariance[k](0, 1));
    }
    const auto poses = api::marker_poses(found[i], 0.08, imager);
    const auto of_room =
        tracker::marker_poses(camera.lens, 0.08, expected[i].corners_px, expected[i].corner_covariance);
    ASSERT_EQ(poses.size(), of_room.size());
    EXPECT_EQ(poses[0].camera_from_marker, api::to_public(of_room[0].camera_from_marker));
    EXPECT_EQ(poses[0].covariance, api::to_public(of_room[0].covariance));
  }
}

TEST(LibraryDetector, ReadsAPartOfALargerImageWhereItIs) {
  cv::Mat large(600, 900, CV_8U, cv::Scalar(120));
  const cv::Rect part(130, 50, 640, 480);
  test::example_image(0).copyTo(large(part));
  api::Detector detector({"apriltag_36h11"});
  const auto alone = detector.detect(view_of(test::example_image(0))),
             inside = detector.detect(view_of(large(part)));
  ASSERT_EQ(inside.size(), 2U);
  EXPECT_EQ(inside[0].corners_px, alone[0].corners_px);
}

TEST(LibraryDetector, SaysWhatItRefuses) {
  EXPECT_THROW(api::Detector({}), api::Error);
  const std::vector<std::string> unknown = {"apriltag_1h1"};
  try {
    const api::Detector detector(unknown);
    FAIL() << "expected an error";
  } catch (const api::Error& error) {
    EXPECT_EQ(error.what(), tracker::Families::load(unknown).message());
  }
  api::Detector detector({"apriltag_36h11"});
  EXPECT_THROW(detector.detect({}), api::Error);
  const api::Imager imager = api::to_public(test::example_camera());
  const cv::Mat small(100, 100, CV_8U, cv::Scalar(0));
  EXPECT_THROW(detector.detect(view_of(small), &imager), api::Error);
}

TEST(LibraryMarkers, CornersOfAnotherDetectorGiveAPose) {
  const api::Imager imager = api::to_public(test::example_camera());
  api::Marker marker{.family = "apriltag_36h11", .id = "0"};
  const auto found = api::Detector({"apriltag_36h11"}).detect(view_of(test::example_image(0)));
  ASSERT_FALSE(found.empty());
  marker.corners_px = found[0].corners_px;
  EXPECT_FALSE(api::marker_poses(marker, 0.08, imager).empty());
  marker.corner_covariances[2] = {0, 0, 0, 0};
  EXPECT_THROW(api::marker_poses(marker, 0.08, imager), api::Error);
}

TEST(LibraryMarkers, ADrawnMarkerIsFound) {
  const api::Image drawn = api::draw_marker("aruco_4x4_50", "7");
  const auto found = api::Detector({"aruco_4x4_50"}).detect(drawn.view());
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].id, "7");
  EXPECT_THROW(api::draw_marker("aruco_4x4_50", "50"), api::Error);
}

}  // namespace
}  // namespace limn
