#include <opencv2/core.hpp>

#include "sim/sensor_model.h"
#include "sim/trace.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"
#include "tracker/balls/ball_finder.h"

namespace limn::sim {
namespace {

constexpr int k_visible = 0, k_infrared = 1;  // the world's cameras

World balls_world() {
  return load_world(test::config_folder() / "worlds/balls.json", tracker::marker_image).value();
}

cv::Mat white_of(const Imager& projector) {
  return cv::Mat(projector.height, projector.width, CV_8UC1, cv::Scalar(255));
}

TEST(Infrared, ACameraSeesNeitherProjectedLightNorTheRooms) {
  World world = balls_world();
  const cv::Mat white = white_of(world.rig.projectors[0]);
  const Samples seen = trace(world, k_infrared, {.edge_samples = 1});
  const cv::Mat dark = ideal_light(world, seen, {}), lit = ideal_light(world, seen, {&white, 1});
  EXPECT_EQ(cv::norm(dark, lit, cv::NORM_INF), 0);
  world.room.ambient = 5;
  EXPECT_EQ(
      cv::norm(dark, ideal_light(world, trace(world, k_infrared, {.edge_samples = 1}), {}), cv::NORM_INF), 0);
  const Samples visible = trace(world, k_visible, {.edge_samples = 1});
  EXPECT_GT(cv::norm(ideal_light(world, visible, {}), ideal_light(world, visible, {&white, 1}), cv::NORM_INF),
            0.5);
}

TEST(Infrared, TheLampReturnsFromBallsAsTheirPaintSays) {
  World world = balls_world();
  const Imager& camera = world.rig.cameras[k_infrared];
  const cv::Mat light = ideal_light(world, trace(world, k_infrared, {.edge_samples = 1}), {});
  const Constellation balls = *world.scene->prototype->constellation;
  const Eigen::Vector3d p_camera = camera.imager_from_world.inverse().translation;
  for (const Eigen::Vector3d& p_ball : balls.p_balls) {
    const Eigen::Vector3d p = world.world_from_prototype * p_ball;
    const double d = (p - p_camera).norm() - balls.radius_m;
    const Eigen::Vector2d px = camera.project(p).value();
    const double expected = 0.85 * 20 / (d * d);
    EXPECT_NEAR(light.at<float>(cvRound(px.y()), cvRound(px.x())), expected, 0.01 * expected);
  }
}

TEST(Infrared, BallsAreSeenWhereTheyAre) {
  World world = balls_world();
  const Imager& camera = world.rig.cameras[k_infrared];
  const Samples seen = trace(world, k_infrared);
  const cv::Mat frame = photograph(world, seen, {}, 1);
  const std::vector<tracker::Ball> found = tracker::BallFinder().find(frame, camera.lens);
  ASSERT_EQ(found.size(), 8u);
  const Constellation frame_balls = *world.scene->prototype->constellation;
  for (const Eigen::Vector3d& p_ball : frame_balls.p_balls) {
    const Eigen::Vector3d p_camera = camera.imager_from_world * (world.world_from_prototype * p_ball);
    const Eigen::Vector2d px = camera.lens.project(p_camera).value();
    const auto nearest = std::ranges::min_element(
        found, {}, [&](const tracker::Ball& ball) { return (ball.centre_px - px).norm(); });
    EXPECT_LT((nearest->centre_px - px).norm(), 0.05);
    EXPECT_NEAR(tracker::distance_of(*nearest, frame_balls.radius_m) / p_camera.norm(), 1, 0.005);
  }
}

TEST(Infrared, AColourCameraIsRefused) {
  nlohmann::json world = test::read_json(test::config_folder() / "worlds/balls.json");
  world["scene"] = (test::config_folder() / "scenes/balls").string();
  const auto message = [&] {
    const auto loaded =
        load_world(test::write_json(test::test_folder() / "world.json", world), tracker::marker_image);
    return loaded ? std::string() : loaded.message();
  };
  EXPECT_EQ(message(), "");
  world["cameras"][1]["colour"] = true;
  EXPECT_NE(message().find("cameras[1].sees"), std::string::npos) << message();
  world["cameras"][1]["colour"] = false;
  world["cameras"][1]["sees"] = "infra";
  EXPECT_NE(message().find("visible, infrared"), std::string::npos) << message();
}

}  // namespace
}  // namespace limn::sim
