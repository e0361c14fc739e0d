// Images for two eyes: projectors in stereo, screens for two eyes, walls.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <span>
#include <vector>

#include "device/gl_context.h"
#include "session/frame_composer.h"
#include "session/perception.h"
#include "sim/virtual_rig.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"

namespace limn::session {
namespace {

// A viewer that stands still.
std::vector<scene::Viewer> seen_from(const Imager& viewer) {
  scene::Viewer out;
  out.fixed = viewer;
  return {out};
}

// One moment of the studio, seen by all of its cameras. Its viewer stands still.
class TheStudioInStereo : public testing::Test {
 protected:
  TheStudioInStereo() {
    sim::World world = test::studio_world(0.5);
    world.scene->viewers = seen_from(viewer_);
    scene::RoomLight light;  // does not move with who looks
    light.below_rgb.setConstant(0.3);
    light.above_rgb.setConstant(0.8);
    world.scene->light = light;
    scene_ = *world.scene;
    seen_by_ = world.rig;
    sim::VirtualRig rig(std::move(world), {.frame_period_s = 0.1, .grab_waits_for_light = false});
    std::vector<int> all(seen_by_.cameras.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
    Perception perception = Perception::create(scene_, seen_by_).value();
    for (int frame = 0; frame < 3; ++frame) percepts_ = perception.watch(rig.expose(all));
    shown_at_ = shifted(rig.now(), 0.033);
  }

  FrameComposer composer(const Imager& viewer, const ComposeOptions& options = {}) const {
    scene::Scene scene = scene_;
    scene.viewers = seen_from(viewer);
    return FrameComposer::create(scene, seen_by_, options).value();
  }
  const ComposedFrame& composed(FrameComposer* composer) const {
    return composer->compose(
        frame_input(scene_, {}, percepts_, scene::initial_show_state(scene_), {shown_at_, shown_at_}));
  }
  EyeImages screen(FrameComposer* composer, const ScreenRequest& request) const {
    return composer->screen(percepts_, predicted_at_capture(percepts_, {}).at_image,
                            scene::initial_show_state(scene_), request);
  }

  device::GlContext context_ = device::GlContext::create().value();
  const Imager viewer_ =
      viewer_imager(looking_at({0.25, -1.1, 0.7}, {0, 0, 0.4}, {0, 0, 1}).inverse(), 480, 360, 50);
  scene::Scene scene_;
  Rig seen_by_;
  Percepts percepts_;
  Stamp shown_at_;
};

double mean_difference(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  const cv::Scalar mean = cv::mean(difference);
  return (mean[0] + mean[1] + mean[2]) / 3;
}

// Each eye's image is the one that a viewer with a single eye in its place would get.
TEST_F(TheStudioInStereo, EachEyeGetsItsOwnLight) {
  const std::string& name = seen_by_.projectors[0].name;
  ComposeOptions options;
  options.stereo_mm = 120;
  options.stereo_projectors = {name};
  FrameComposer both = composer(viewer_, options);
  const ComposedFrame& light = composed(&both);
  ASSERT_FALSE(light.right_eyes[0].empty());
  EXPECT_TRUE(light.right_eyes[1].empty()) << "the other projector is not in stereo";
  EXPECT_GT(mean_difference(light.projectors[0], light.right_eyes[0]), 0.1) << "the eyes see other light";
  const auto [left, right] = eyes(viewer_, 0.12);
  FrameComposer at_left = composer(left), at_right = composer(right), between = composer(viewer_);
  EXPECT_LT(mean_difference(composed(&at_left).projectors[0], light.projectors[0]), 0.02);
  EXPECT_LT(mean_difference(composed(&at_right).projectors[0], light.right_eyes[0]), 0.02);
  EXPECT_EQ(cv::norm(composed(&between).projectors[1], light.projectors[1], cv::NORM_INF), 0);
  EXPECT_EQ(light.eye_images().size(), seen_by_.projectors.size() + 1);
}

TEST_F(TheStudioInStereo, AScreenShowsTheViewOfEachEye) {
  FrameComposer mono = composer(viewer_);
  composed(&mono);
  const EyeImages images = screen(&mono, {.what = scene::Screen::view, .for_two_eyes = true});
  ASSERT_TRUE(images.is_stereo());
  const EyeImages beside = screen(&mono, {.what = scene::Screen::stereo});
  EXPECT_FALSE(beside.is_stereo());
  EXPECT_EQ(cv::norm(beside.left, both(images), cv::NORM_INF), 0) << "for one eye they are side by side";
}

// Without two cameras side by side both eyes get one image. With them each gets its camera's, rectified.
TEST_F(TheStudioInStereo, CompositesComeFromTwoCamerasWhereTheyFit) {
  const ScreenRequest request{.what = scene::Screen::full, .for_two_eyes = true};
  FrameComposer studio = composer(viewer_);
  composed(&studio);
  ASSERT_FALSE(projector::StereoCameras::chosen(seen_by_)) << "the studio's cameras stand far apart";
  const EyeImages one = screen(&studio, request);
  EXPECT_FALSE(one.is_stereo());
  EXPECT_EQ(cv::norm(one.left, screen(&studio, {.what = scene::Screen::full}).left, cv::NORM_INF), 0);

  seen_by_.cameras.resize(1);
  seen_by_.cameras.push_back(eyes(seen_by_.cameras[0], 0.13)[1]);
  seen_by_.cameras[1].name = "camera1";
  FrameComposer pair = composer(viewer_);
  composed(&pair);
  const auto cameras = projector::StereoCameras::chosen(seen_by_);
  ASSERT_TRUE(cameras);
  percepts_.frames.resize(2);
  percepts_.frames[1].image = percepts_.frames[0].image.clone();
  const EyeImages images = screen(&pair, request);
  ASSERT_TRUE(images.is_stereo());
  EXPECT_EQ(images.right.size(), images.left.size());
  EXPECT_GT(mean_difference(images.left, images.right), 0.2) << "the parts are drawn for each camera";
  cv::Mat behind = percepts_.frames[0].image;
  if (behind.channels() == 1) cv::cvtColor(behind, behind, cv::COLOR_GRAY2BGR);
  const EyeImages photos = cameras->rectified({behind, behind});
  cv::Mat same;
  cv::absdiff(photos.left, images.left, same);
  cv::Mat grey;
  cv::cvtColor(same, grey, cv::COLOR_BGR2GRAY);
  EXPECT_GT(cv::countNonZero(grey < 2), 0.5 * static_cast<double>(grey.total()))
      << "beside the parts it is the camera's image";
}

// What the wall shows at a pixel is what the eye sees in that direction.
TEST_F(TheStudioInStereo, AWallShowsWhatTheEyeSeesThroughIt) {
  const Wall wall{{-0.45, -0.25, 0.7}, {0.4, -0.35, 0.7}, {-0.45, -0.25, 0.1}};
  const cv::Size pixels(510, 360);
  FrameComposer mono = composer(viewer_);
  composed(&mono);
  const EyeImages through = screen(&mono, {.what = scene::Screen::rest, .wall = wall, .wall_pixels = pixels});
  ASSERT_EQ(through.left.size(), pixels);
  EXPECT_FALSE(through.is_stereo());
  const cv::Mat seen = screen(&mono, {.what = scene::Screen::view}).left;
  std::vector<int> differences;
  int bright = 0;
  for (int row = 4; row < pixels.height; row += 8)
    for (int column = 4; column < pixels.width; column += 8) {
      const Eigen::Vector3d p = wall.top_left +
                                (column + 0.5) / pixels.width * (wall.top_right - wall.top_left) +
                                (row + 0.5) / pixels.height * (wall.bottom_left - wall.top_left);
      const auto px = viewer_.project(p);
      if (!px || px->x() < 1 || px->y() < 1 || px->x() > 478 || px->y() > 358) continue;
      const cv::Vec3b a = through.left.at<cv::Vec3b>(row, column);
      const cv::Vec3b b =
          seen.at<cv::Vec3b>(static_cast<int>(std::lround(px->y())), static_cast<int>(std::lround(px->x())));
      differences.push_back(std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])}));
      bright += a[1] > 80;
    }
  ASSERT_GT(differences.size(), 1000U);
  EXPECT_GT(bright, 300) << "the prototype is in view";
  std::sort(differences.begin(), differences.end());
  EXPECT_LE(differences[differences.size() * 9 / 10], 6);

  const EyeImages both_eyes =
      screen(&mono, {.what = scene::Screen::view, .for_two_eyes = true, .wall = wall, .wall_pixels = pixels});
  ASSERT_TRUE(both_eyes.is_stereo());
  EXPECT_GT(mean_difference(both_eyes.left, both_eyes.right), 0.2);
  const Wall turned{wall.top_right, wall.top_left, wall.bottom_left + wall.top_right - wall.top_left};
  EXPECT_TRUE(
      screen(&mono, {.what = scene::Screen::view, .wall = turned, .wall_pixels = pixels}).left.empty())
      << "the viewer is behind it";
}

}  // namespace
}  // namespace limn::session
