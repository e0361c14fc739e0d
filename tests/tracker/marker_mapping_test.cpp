#include "tracker/marker_mapping.h"

#include <Eigen/Dense>
#include <cstdio>

#include "tests/support/matchers.h"
#include "tests/tracker/seen_body.h"

namespace limn::tracker {
namespace {

using namespace test::literals;

// Six markers of 40 mm around a prism of 60 mm radius, faces outwards.
Body prism() {
  Body body{"prism", {}};
  for (int i = 0; i < 6; ++i) {
    const Pose face(exp_rotation({0, i * 60_deg, 0}), {0, 0, 0});
    body.markers.push_back({{"aruco_4x4_50", std::to_string(i)},
                            0.04,
                            face * Pose(exp_rotation({0.1 * i, 0, 0.3 * i}), {0, 0.01 * i, -0.06})});
  }
  return body;
}

struct Images {
  Imager camera = test::camera_1080p();
  std::vector<std::vector<Detection>> detections;

  std::vector<View> views() const {
    std::vector<View> all;
    for (const auto& found : detections) all.push_back({&camera, found});
    return all;
  }
};

// The body turns about its axis and nods, `depth` away; only markers that face the camera are found.
Images images_of(const Body& body, int count, double depth, double noise_px, std::mt19937_64& rng) {
  std::uniform_real_distribution<double> nod(-0.5, 0.5), aside(-0.1, 0.1);
  Images images;
  for (int i = 0; i < count; ++i) {
    const Pose world_from_body(exp_rotation({nod(rng), 0, nod(rng)}) * exp_rotation({0, 6.28 * i / count, 0}),
                               {aside(rng), aside(rng), depth});
    Body facing{body.name, {}};
    for (const BodyMarker& marker : body.markers) {
      const Pose camera_from_marker = world_from_body * marker.body_from_marker;
      const double cos_tilt = (camera_from_marker.rotation * Eigen::Vector3d::UnitZ())
                                  .dot(camera_from_marker.translation.normalized());
      if (cos_tilt > 0.35) facing.markers.push_back(marker);
    }
    images.detections.push_back(test::detections_of(facing, images.camera, world_from_body, noise_px, rng));
  }
  return images;
}

Pose true_pose(const Body& body, const MarkerName& frame, const MarkerName& marker) {
  const auto pose = [&](const MarkerName& name) {
    for (const BodyMarker& m : body.markers)
      if (m.marker == name) return m.body_from_marker;
    throw std::logic_error("no such marker");
  };
  return pose(frame).inverse() * pose(marker);
}

TEST(LearnedBody, ComesBackExactlyFromPerfectCorners) {
  auto rng = test::test_rng();
  const Body body = prism();
  Images images = images_of(body, 12, 0.6, 1e-6, rng);
  const auto learned = map_markers(images.views(), 0.04);
  ASSERT_TRUE(learned) << learned.message();
  ASSERT_EQ(learned->markers.size(), 6u);
  EXPECT_EQ(learned->images, 12);
  EXPECT_TRUE(learned->unplaced.empty());
  for (const MappedMarker& marker : learned->markers)
    EXPECT_TRUE(test::pose_near(marker.marker.body_from_marker,
                                true_pose(body, learned->frame, marker.marker.marker), 1e-5, 1e-6));
}

TEST(LearnedBody, HasTheDeviationsOfItsErrorsFarAwayToo) {
  auto rng = test::test_rng();
  const Body body = prism();
  for (const double depth : {0.6, 2.0}) {  // 107 px, 32 px
    double normalised = 0, worst_mm = 0, worst_deg = 0, stated_mm = 0;
    int count = 0;
    for (int round = 0; round < 12; ++round) {
      const Images images = images_of(body, 24, depth, 0.1, rng);
      const auto learned = map_markers(images.views(), 0.04);
      ASSERT_TRUE(learned) << learned.message();
      ASSERT_EQ(learned->markers.size(), 6u);
      for (const MappedMarker& marker : learned->markers) {
        if (marker.marker.marker == learned->frame) continue;
        const Vector6d error =
            boxminus(marker.marker.body_from_marker, true_pose(body, learned->frame, marker.marker.marker));
        normalised += error.dot(marker.covariance.inverse() * error) / 6;
        worst_mm = std::max(worst_mm, 1e3 * error.tail<3>().norm());
        worst_deg = std::max(worst_deg, error.head<3>().norm() / 1_deg);
        stated_mm = std::max(stated_mm, 1e3 * std::sqrt(marker.covariance.bottomRightCorner<3, 3>().trace()));
        ++count;
      }
    }
    std::printf(
        "learned from 24 pictures at %.1f m, 0.1 px: worst of %d markers %.2f mm, %.2f degrees; largest "
        "stated "
        "deviation %.2f mm; normalised %.2f\n",
        depth, count, worst_mm, worst_deg, stated_mm, normalised / count);
    EXPECT_GT(normalised / count, 0.7);
    EXPECT_LT(normalised / count, 1.4);
  }
}

TEST(LearnedBody, LeavesOutWhatIsTwiceInAnImageAndNamesWhatItCannotPlace) {
  auto rng = test::test_rng();
  const Body body = prism();
  Images images = images_of(body, 12, 0.6, 0.05, rng);
  const Body elsewhere{"elsewhere",
                       {{{"aruco_4x4_50", "40"}, 0.04, Pose{}},
                        {{"aruco_4x4_50", "41"}, 0.04, Pose(exp_rotation({0, 0, 1}), {0.1, 0, 0})}}};
  images.detections.push_back(
      test::detections_of(elsewhere, images.camera, Pose(exp_rotation({0.5, 0, 0}), {0, 0, 0.6}), 0.05, rng));
  Detection twice = images.detections[0][0];
  for (auto& px : twice.corners_px) px += Eigen::Vector2d(200, 0);
  images.detections[0].push_back(twice);
  const auto learned = map_markers(images.views(), 0.04);
  ASSERT_TRUE(learned) << learned.message();
  ASSERT_EQ(learned->unplaced.size(), 2u);
  EXPECT_EQ(learned->unplaced[0].id, "40");
  EXPECT_LT(learned->rms_px, 0.1);
  for (const MappedMarker& marker : learned->markers)
    EXPECT_TRUE(test::pose_near(marker.marker.body_from_marker,
                                true_pose(body, learned->frame, marker.marker.marker), 0.5_deg, 0.5_mm));
}

TEST(LearnedBody, SaysWhenNoTwoMarkersAreTogether) {
  auto rng = test::test_rng();
  const Body body = test::body_of(1);
  Images images = images_of(body, 3, 0.6, 0.05, rng);
  const auto learned = map_markers(images.views(), 0.04);
  ASSERT_FALSE(learned);
  EXPECT_NE(learned.message().find("two or more markers"), std::string::npos);
}

}  // namespace
}  // namespace limn::tracker
