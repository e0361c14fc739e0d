#include "sim/virtual_rig.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "tests/sim/small_world.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

using namespace test;

cv::Mat flat(int value) { return {150, 200, CV_8U, cv::Scalar(value)}; }

double brightness(const Frame& frame) { return cv::mean(frame.image)[0]; }

TEST(VirtualRig, AGrabShowsWhatWasShownLast) {
  sim::VirtualRig rig(small_world());
  ASSERT_TRUE(rig.projector(0).show(flat(255)));
  const double white = brightness(rig.camera(0).next().value());
  ASSERT_TRUE(rig.projector(0).show(flat(100)));
  const double grey = brightness(rig.camera(0).next().value());
  rig.darken();
  const double black = brightness(rig.camera(0).next().value());
  EXPECT_GT(white, 30);
  EXPECT_NEAR(grey / white, 100.0 / 255, 0.01);
  EXPECT_EQ(black, 0);
}

TEST(VirtualRig, LightComesAfterTheDisplaysDelay) {
  sim::VirtualRigOptions options;
  options.display_delay_s = 0.050;
  options.frame_period_s = 0.020;
  options.camera_delay_s = 0.001;
  options.grab_waits_for_light = false;
  sim::VirtualRig rig(small_world(), options);
  const Stamp shown_at = rig.projector(0).show(flat(255)).value();
  EXPECT_NEAR(seconds_between(Stamp{}, shown_at), 0.050, 1e-9);
  int dark = 0;
  for (int i = 1; i <= 5; ++i) {
    const Frame frame = rig.camera(0).next().value();
    EXPECT_NEAR(seconds_between(Stamp{}, frame.captured_at), 0.020 * i, 1e-9);
    EXPECT_EQ(brightness(frame) > 0, frame.captured_at >= shown_at) << i;
    dark += brightness(frame) > 0 ? 0 : 1;
  }
  EXPECT_EQ(dark, 2);
}

TEST(VirtualRig, StampsRiseAndTheClockIsVirtual) {
  sim::VirtualRig rig(small_world());
  const Frame a = rig.camera(0).next().value(), b = rig.camera(0).next().value();
  EXPECT_GT(b.captured_at, a.captured_at);
  EXPECT_GE(rig.now(), b.captured_at);
  EXPECT_EQ(a.camera, "camera0");
}

TEST(VirtualRig, MovingAnObjectChangesTheImage) {
  sim::World world = small_world();
  world.objects.push_back(sim::sheet("board", 0.1, 0.1, {}, facing_minus_y(0, 0.9, 0)));
  world.room.ambient = 0.5;
  sim::VirtualRig rig(std::move(world));
  const cv::Mat before = rig.camera(0).next().value().image;
  rig.move("board", facing_minus_y(0.15, 0.9, 0));
  const cv::Mat after = rig.camera(0).next().value().image;
  EXPECT_GT(cv::norm(before, after, cv::NORM_INF), 5);
  rig.move("board", facing_minus_y(0, 0.9, 0));
  EXPECT_TRUE(image_near(rig.camera(0).next().value().image, before, 0, 0, "moved-back"));
  rig.remove("board");
  EXPECT_EQ(rig.world().find("board"), nullptr);
}

TEST(VirtualRig, AClearStageComesBack) {
  sim::World world = small_world();
  world.world_from_prototype = facing_minus_y(0, 0.8, 0);
  world.objects.push_back(sim::sheet("prototype", 0.2, 0.2, {}, world.world_from_prototype));
  world.objects.back().prototype_from_object = Pose();
  world.camera_effects[0].colour = true;
  world.room.ambient = 0.5;
  sim::VirtualRig rig(std::move(world));
  const cv::Mat before = rig.camera(0).next().value().image;
  rig.remove_prototype();
  const cv::Mat clear = rig.camera(0).next().value().image;
  EXPECT_EQ(clear.channels(), 1);
  for (const auto object : rig.samples(0).object) ASSERT_EQ(object, 0);  // only the wall
  rig.restore_prototype();
  EXPECT_TRUE(image_near(rig.camera(0).next().value().image, before, 0, 0, "restored"));
}

TEST(VirtualRig, AnImageOfTheWrongSizeIsRefusedWithBothSizes) {
  sim::VirtualRig rig(small_world());
  const auto shown = rig.projector(0).show(cv::Mat::zeros(10, 20, CV_8U));
  ASSERT_FALSE(shown);
  EXPECT_NE(shown.message().find("200x150"), std::string::npos) << shown.message();
  EXPECT_NE(shown.message().find("20x10"), std::string::npos) << shown.message();
  EXPECT_FALSE(rig.projector(0).show(cv::Mat::zeros(150, 200, CV_16U)));
}

}  // namespace
}  // namespace limn
