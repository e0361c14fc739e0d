#include "limn/bodies.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/file.h"
#include "library/body_conversion.h"
#include "library/convert.h"
#include "library/marker_conversion.h"
#include "scene/marker_file.h"
#include "tests/library/example_inputs.h"
#include "tests/support/matchers.h"
#include "tracker/body_estimate.h"
#include "tracker/body_filter.h"
#include "tracker/predict.h"

namespace limn {
namespace {

namespace api = LIMN_VERSIONED;

constexpr double k_frame_s = 1 / 30.0;

// The true corners of the example's body at image `i`.
std::vector<api::Marker> markers_at(int i) {
  const Imager camera = test::example_camera();
  std::vector<api::Marker> markers;
  for (const BodyMarker& on_body : test::example_body().markers) {
    api::Marker marker{.family = on_body.marker.family, .id = on_body.marker.id, .score = 1};
    const double half = on_body.size_m / 2;
    const std::array<Eigen::Vector3d, 4> square = {
        Eigen::Vector3d(-half, -half, 0), Eigen::Vector3d(half, -half, 0), Eigen::Vector3d(half, half, 0),
        Eigen::Vector3d(-half, half, 0)};
    for (std::size_t k = 0; k < 4; ++k) {
      const Pose world_from_marker = test::world_from_example_body(i) * on_body.body_from_marker;
      marker.corners_px[k] = api::to_public(*camera.project(world_from_marker * square[k]));
      marker.corner_covariances[k] = {0.01, 0, 0, 0.01};
    }
    markers.push_back(marker);
  }
  return markers;
}

std::vector<tracker::Detection> detections_of(const std::vector<api::Marker>& markers) {
  std::vector<tracker::Detection> detections;
  for (const api::Marker& marker : markers) detections.push_back(api::detection_of(marker));
  return detections;
}

TEST(LibraryTracker, PredictsWhatTheRoomPredictsToTheBit) {
  const Imager camera = test::example_camera();
  const api::Imager imager = api::to_public(camera);
  const std::vector<Body> bodies = {test::example_body()};
  api::Tracker follower(api::public_of(bodies));
  std::vector<tracker::BodyFilter> filters;
  for (int i = 0; i < 6; ++i) {
    const std::vector<api::Marker> markers = markers_at(i);
    const api::View view{&imager, markers};
    follower.update({&view, 1}, i * k_frame_s);
    const auto detections = detections_of(markers);
    const tracker::View room{&camera, detections};
    filters = tracker::observed(filters, bodies, {&room, 1}, shifted(Stamp{}, i * k_frame_s));
  }
  const double shown_at_s = 5 * k_frame_s + 0.02;
  const auto tracks = follower.predict(shown_at_s);
  const auto expected = tracker::predicted(filters, shifted(Stamp{}, shown_at_s));
  ASSERT_EQ(tracks.size(), 1U);
  ASSERT_EQ(expected.size(), 1U);
  EXPECT_EQ(tracks[0].world_from_body, api::to_public(expected[0].world_from_body));
  EXPECT_EQ(tracks[0].covariance, api::to_public(expected[0].covariance));
  EXPECT_EQ(tracks[0].marker_count, 2);
  EXPECT_EQ(tracks[0].tracking, api::Tracking::measured);
  EXPECT_NEAR(tracks[0].at_s, shown_at_s, 1e-9);
  EXPECT_EQ(follower.predict(10)[0].tracking, api::Tracking::lost);
}

TEST(LibraryBodies, AreLocatedInOneMoment) {
  const api::Imager imager = api::to_public(test::example_camera());
  const std::vector<api::Marker> markers = markers_at(2);
  const api::View view{&imager, markers};
  const auto tracks = api::locate_bodies(api::public_of({test::example_body()}), {&view, 1});
  ASSERT_EQ(tracks.size(), 1U);
  const api::Point3 p = tracks[0].world_from_body.translation;
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(p[static_cast<std::size_t>(k)], test::world_from_example_body(2).translation[k], 1e-6);
  const api::View without_camera{nullptr, markers};
  EXPECT_THROW(api::locate_bodies(api::public_of({test::example_body()}), {&without_camera, 1}), api::Error);
}

TEST(LibraryBodies, TracksOfTheCallerAreChecked) {
  api::Track track{.body = "tool", .tracking = api::Tracking::lost};
  EXPECT_EQ(api::room_of(track).tracking, TrackingState::lost);
  track.tracking = static_cast<api::Tracking>(3);
  EXPECT_THROW(api::room_of(track), api::Error);
  track.tracking = api::Tracking::measured;
  track.covariance[7] = std::nan("");
  EXPECT_THROW(api::room_of(track), api::Error);
}

TEST(LibraryBodies, AreReadAndChecked) {
  const auto file = test::test_folder() / "body.json";
  ASSERT_TRUE(write_file(file, scene::marker_file_json(test::example_body().markers)));
  api::Body body = api::load_body(file, "tool");
  EXPECT_EQ(body.name, "tool");
  ASSERT_EQ(body.markers.size(), 2U);
  EXPECT_EQ(api::families_of({&body, 1}), std::vector<std::string>{"apriltag_36h11"});
  EXPECT_THROW(api::Tracker({body, body}), api::Error);
  body.markers[0].size_m = 0;
  EXPECT_THROW(api::Tracker({body}), api::Error);
  EXPECT_THROW(api::load_body(file.parent_path() / "none.json", "tool"), api::Error);
}

}  // namespace
}  // namespace limn
