#include "tracker/marker_light.h"

#include <opencv2/imgproc.hpp>

#include "tests/support/matchers.h"
#include "tests/tracker/seen_body.h"

namespace limn::tracker {
namespace {

using namespace test::literals;

Imager projector() {
  return {"projector0", 1280, 800,
          Lens::create("LENSMODEL_OPENCV4", {1800, 1810, 630, 700, -0.1, 0.02, 1e-4, 2e-4}).value(),
          looking_at({0.4, -0.3, 0}, {0, 0, 1}, {0, -1, 0})};
}

Track track_of(const Body& body, const Pose& world_from_body) {
  Track track;
  track.body = body.name;
  track.world_from_body = world_from_body;
  return track;
}

TEST(MarkerMask, CoversExactlyThePaperThroughTheProjectorsLens) {
  const Body body = test::body_of(4);
  const Imager imager = projector();
  const Track track = track_of(body, Pose(exp_rotation({0.2, -0.1, 0.4}), {0.02, 0.01, 1}));
  const cv::Mat mask = marker_mask(imager, std::span(&body, 1), std::span(&track, 1), {.margin = 0.2});
  // For every projector pixel whose ray meets a marker's plane: it is inside or outside the paper.
  int wrong = 0, on = 0;
  for (int row = 0; row < mask.rows; row += 2)
    for (int column = 0; column < mask.cols; column += 2) {
      const auto ray = imager.ray({column, row});
      ASSERT_TRUE(ray);
      bool inside = false, at_edge = false;
      for (const BodyMarker& marker : body.markers) {
        const Pose marker_from_world = (track.world_from_body * marker.body_from_marker).inverse();
        const Eigen::Vector3d p = marker_from_world * ray->p_origin, d = marker_from_world.rotation * ray->d;
        const Eigen::Vector3d at = p - p.z() / d.z() * d;
        const double reach = std::max(std::abs(at.x()), std::abs(at.y())) - 0.7 * marker.size_m;
        inside = inside || reach < 0;
        at_edge = at_edge || std::abs(reach) < 1_mm;  // a projector pixel is 0.6 mm
      }
      const bool lit = mask.at<std::uint8_t>(row, column) == 255;
      on += lit;
      wrong += lit != inside && !at_edge;
    }
  EXPECT_GT(on, 1000);
  EXPECT_EQ(wrong, 0);
}

TEST(MarkerMask, WidensByTheTracksUncertaintyAndLeavesOutWhatIsLostOrTurnedAway) {
  const Body body = test::body_of(1);
  const Imager imager = projector();
  Track track = track_of(body, Pose(Eigen::Quaterniond::Identity(), {0, 0, 1}));
  const auto lit = [&] {
    return cv::countNonZero(marker_mask(imager, std::span(&body, 1), std::span(&track, 1)));
  };
  const int sure = lit();
  track.covariance.bottomRightCorner<3, 3>() = 1e-4 * Eigen::Matrix3d::Identity();  // 10 mm
  EXPECT_NEAR(static_cast<double>(lit()) / sure, std::pow((50 + 2 * 30) / 50.0, 2), 0.1);
  track.tracking = TrackingState::lost;
  EXPECT_EQ(lit(), 0);
  track.tracking = TrackingState::measured;
  track.world_from_body.rotation = exp_rotation({0, 180_deg, 0});
  EXPECT_EQ(lit(), 0);
}

TEST(MarkerMask, LightsSparesOrLeavesTheImage) {
  const cv::Mat image(4, 4, CV_8UC3, cv::Scalar(10, 20, 30));
  cv::Mat mask = cv::Mat::zeros(4, 4, CV_8UC1);
  mask.at<std::uint8_t>(1, 2) = 255;
  EXPECT_EQ(with_marker_light(image, mask, MarkerLight::keep_out).at<cv::Vec3b>(1, 2), cv::Vec3b(0, 0, 0));
  EXPECT_EQ(with_marker_light(image, mask, MarkerLight::spotlight).at<cv::Vec3b>(1, 2),
            cv::Vec3b(255, 255, 255));
  EXPECT_EQ(with_marker_light(image, mask, MarkerLight::as_is).at<cv::Vec3b>(1, 2), cv::Vec3b(10, 20, 30));
  EXPECT_EQ(with_marker_light(image, mask, MarkerLight::keep_out).at<cv::Vec3b>(1, 1), cv::Vec3b(10, 20, 30));
}

// Five balls in front of the projector.
Constellation five_balls() {
  return {
      "five",
      0.02,
      {{-0.08, -0.06, 0}, {0.1, -0.05, 0.02}, {-0.02, 0.09, -0.01}, {0.05, 0.03, 0.08}, {-0.07, 0.02, 0.06}}};
}

TEST(BallMask, CoversExactlyTheSpheresThroughTheProjectorsLens) {
  const Constellation balls = five_balls();
  const Imager imager = projector();
  Track track;
  track.body = "five";
  track.world_from_body = Pose(exp_rotation({0.2, -0.1, 0.4}), {0.02, 0.01, 1});
  const cv::Mat mask = ball_mask(imager, std::span(&balls, 1), std::span(&track, 1), {.margin = 0.25});
  int wrong = 0, on = 0;
  for (int row = 0; row < mask.rows; row += 2)
    for (int column = 0; column < mask.cols; column += 2) {
      const Ray ray = imager.ray({column, row}).value();
      double beside = 1;  // distance of the ray from the nearest widened sphere
      for (const Eigen::Vector3d& p : balls.p_balls)
        beside = std::min(beside, ray.d.cross(track.world_from_body * p - ray.p_origin).norm() - 1.5 * 0.02);
      const bool lit = mask.at<std::uint8_t>(row, column) == 255;
      on += lit;
      wrong += lit != (beside < 0) && std::abs(beside) > 1_mm;  // a projector pixel is 0.6 mm
    }
  EXPECT_GT(on, 1000);
  EXPECT_EQ(wrong, 0);
}

TEST(BallMask, WhatOnlyInfraredCamerasSeeIsNotKeptDark) {
  const Constellation balls = five_balls();
  const Body body = test::body_of(1);
  std::vector<Track> tracks = {track_of(body, Pose(Eigen::Quaterniond::Identity(), {0, 0, 1}))};
  tracks.push_back(tracks[0]);
  tracks[1].body = "five";
  Imager beside = projector(), camera = projector();
  camera.sees = Spectrum::infrared;
  beside.imager_from_world.translation.x() += 3;  // sees neither
  const auto seen = [&](std::vector<Imager> cameras) {
    return seen_in_visible_light(cameras, std::span(&body, 1), std::span(&balls, 1), tracks).size();
  };
  EXPECT_EQ(seen({projector(), camera}), 2u);
  EXPECT_EQ(seen({camera}), 0u);
  EXPECT_EQ(seen({camera, beside}), 0u);
}

}  // namespace
}  // namespace limn::tracker
