// What the displays of a session on devices show.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "apps/replay.h"
#include "core/image_io.h"
#include "device/gl_context.h"
#include "device/image_sequence_camera.h"
#include "device/stereo_display.h"
#include "session/device_session.h"
#include "session/perception.h"
#include "session/session.h"
#include "sim/virtual_rig.h"
#include "tests/session/studio.h"
#include "tests/support/canvas.h"
#include "tests/support/matchers.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using test::Canvas;

constexpr double k_limit_s = 300;  // a session that goes well ends long before
constexpr int k_lit_bytes = 1000;

// Three screens, as in a devices file; the recording has their names.
TEST(Live, EachScreenShowsWhatWasChosenForIt) {
  const fs::path folder = test::test_folder();
  const sim::World world = studio_world(0.34);
  SessionSetup setup{world.rig, *world.scene, {}, {}, {"wall", "desk", "roof"}};
  sim::VirtualRig room(world, {.grab_waits_for_light = false});
  const cv::Mat seen = room.camera(0).next()->image;
  ASSERT_TRUE(write_png(folder / "seen.png", seen));
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  auto output = SessionOutput::open({}, folder / "recording", &setup);
  ASSERT_TRUE(output) << output.message();
  EXPECT_EQ(setup.screens.size(), 3u);
  auto perception = Perception::create(setup.scene, setup.rig);
  auto session = Session::create(setup, &output->telemetry(), output->recorder(), false);
  ASSERT_TRUE(perception && session);
  for (const auto& [screen, what] : {std::pair{"", "full"}, {"wall", "camera"}, {"roof", "off"}})
    ASSERT_TRUE(session->edit({"screen", screen, what}, "test", {}));
  SessionDevices devices;
  devices.cameras.push_back(std::make_unique<device::ImageSequenceCamera>(
      device::ImageSequenceCamera::open(folder / "seen.png", {.repeat = true}).value()));
  const Imager& projector = setup.rig.projectors[0];
  devices.projectors.resize(setup.rig.projectors.size());
  devices.projectors[0] =
      std::make_unique<Canvas>(projector.name, cv::Size(projector.width, projector.height));
  std::vector<Canvas*> screens;
  for (const std::string& name : setup.screens) {
    auto canvas = std::make_unique<Canvas>(name, seen.size());
    screens.push_back(canvas.get());
    devices.screens.push_back(std::move(canvas));
  }
  std::atomic<bool> is_ended = false;
  screens[1]->on_show = [&] {
    is_ended = !screens[0]->shown.empty() && !screens[2]->shown.empty() &&
               cv::norm(screens[0]->shown, seen, cv::NORM_INF) == 0 &&
               cv::norm(screens[1]->shown, seen, cv::NORM_INF) > 50;
  };
  const Status played = play_on_devices(&devices, k_limit_s, is_ended, {*perception, *session, *output});
  ASSERT_TRUE(played) << played.message();
  for (const Canvas* screen : screens) ASSERT_FALSE(screen->shown.empty()) << screen->name();
  EXPECT_EQ(cv::norm(screens[0]->shown, seen, cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(screens[1]->shown, seen, cv::NORM_INF), 50) << "this screen shows parts";
  EXPECT_EQ(cv::countNonZero(screens[2]->shown.reshape(1)), 0);
  ASSERT_TRUE(output->close(&*session, false));
  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();
}

// A projector with its eyes' images one above the other, a screen with them side by side, and a wall. The
// recording knows which projector is in stereo.
TEST(Live, DisplaysInStereoAndWallsShowWhatEachEyeSees) {
  const fs::path folder = test::test_folder();
  const sim::World world = studio_world(0.34);
  SessionSetup setup{world.rig, *world.scene, {}, {}, {"wall", "desk"}};
  const Imager projector = world.rig.projectors[0];
  setup.paint.stereo_projectors = {projector.name};
  sim::VirtualRig room(world, {.grab_waits_for_light = false});
  ASSERT_TRUE(write_png(folder / "seen.png", room.camera(0).next()->image));
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  auto output = SessionOutput::open({}, folder / "recording", &setup);
  ASSERT_TRUE(output) << output.message();
  auto perception = Perception::create(setup.scene, setup.rig);
  auto session = Session::create(setup, &output->telemetry(), output->recorder(), false);
  ASSERT_TRUE(perception && session);
  ASSERT_TRUE(session->edit({"screen", "desk", "view"}, "test", {}));
  SessionDevices devices;
  devices.cameras.push_back(std::make_unique<device::ImageSequenceCamera>(
      device::ImageSequenceCamera::open(folder / "seen.png", {.repeat = true}).value()));
  std::vector<Canvas*> shown;
  const auto canvas = [&](const std::string& name, cv::Size size) {
    auto out = std::make_unique<Canvas>(name, size);
    shown.push_back(out.get());
    return out;
  };
  devices.projectors.resize(setup.rig.projectors.size());
  devices.projectors[0] = std::make_unique<device::StereoDisplay>(
      canvas(projector.name, {projector.width, projector.height}), StereoLayout::top_bottom);
  devices.screens.push_back(canvas("wall", {400, 300}));
  devices.screens.push_back(
      std::make_unique<device::StereoDisplay>(canvas("desk", {400, 300}), StereoLayout::side_by_side));
  const Pose world_from_viewer = world.scene->viewers.at(0).fixed.value().imager_from_world.inverse();
  const auto through = [&](double x, double y) {  // the wall is 0.5 m before the scene's viewer
    return Eigen::Vector3d(world_from_viewer * Eigen::Vector3d(x, y, 0.5));
  };
  devices.walls["wall"] = {through(-0.2, -0.15), through(0.2, -0.15), through(-0.2, 0.15)};
  std::atomic<bool> is_ended = false;
  shown[2]->on_show = [&] {
    is_ended = std::ranges::all_of(shown, [](const Canvas* one) { return one->most_lit > k_lit_bytes; });
  };
  const Status played = play_on_devices(&devices, k_limit_s, is_ended, {*perception, *session, *output});
  ASSERT_TRUE(played) << played.message();
  for (const Canvas* canvas : shown) ASSERT_GT(canvas->most_lit, k_lit_bytes) << canvas->name();
  const cv::Mat light = shown[0]->most_lit_image, wall = shown[1]->most_lit_image,
                desk = shown[2]->most_lit_image;
  EXPECT_GT(cv::norm(light.rowRange(0, light.rows / 2), light.rowRange(light.rows / 2, 2 * (light.rows / 2)),
                     cv::NORM_INF),
            50);
  EXPECT_GT(cv::norm(desk.colRange(0, 200), desk.colRange(200, 400), cv::NORM_INF), 50);
  EXPECT_GT(cv::norm(wall.at<cv::Vec3b>(150, 200), wall.at<cv::Vec3b>(2, 2), cv::NORM_INF), 20)
      << "the prototype, through the wall";
  ASSERT_TRUE(output->close(&*session, false));
  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();
}

}  // namespace
}  // namespace limn::session
