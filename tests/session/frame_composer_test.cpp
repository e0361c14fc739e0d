#include "session/frame_composer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <span>

#include "device/gl_context.h"
#include "scene/volume_part.h"
#include "session/perception.h"
#include "sim/virtual_rig.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"

namespace limn::session {
namespace {

using namespace test::literals;

// Its markers are measured slightly differently in every image, and it must not move with that noise. A real
// move of less than half a millimetre must be shown.
TEST(FrameComposer, APrototypeThatStandsStillIsShownWhereItWas) {
  sim::World world = test::studio_world(0.5);
  const auto object = std::find_if(world.objects.begin(), world.objects.end(),
                                   [](const sim::Object& o) { return o.name == "prototype"; });
  ASSERT_NE(object, world.objects.end());
  Pose moved = object->world_from_object;
  const scene::Scene scene = *world.scene;
  const Rig seen_by = world.rig;
  sim::VirtualRig rig(std::move(world), {.frame_period_s = 0.1, .grab_waits_for_light = false});
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  Perception perception = Perception::create(scene, seen_by).value();
  FrameComposer composer = FrameComposer::create(scene, seen_by).value();
  const scene::ShowState show_state = scene::initial_show_state(scene);
  struct Place {
    Pose shown, estimated;
  };
  const auto place = [&]() -> Place {
    const int camera = 0;
    const Percepts& percepts = perception.watch(rig.expose(std::span(&camera, 1)));
    const Stamp shown_at = shifted(rig.now(), 0.033);
    const ComposedFrame& painted =
        composer.compose(frame_input(scene, {}, percepts, show_state, {rig.now(), shown_at}));
    for (std::size_t i = 0; i < painted.projectors.size(); ++i)
      EXPECT_TRUE(rig.projector(static_cast<int>(i)).show(painted.projectors[i]));
    Place place{painted.posed.world_from_prototype.value_or(Pose{}), {}};
    for (const Track& track : tracker::predicted(percepts.motions, shown_at))
      if (track.body == "prototype") place.estimated = track.world_from_body;
    return place;
  };
  const auto apart_m = [](const Pose& a, const Pose& b) { return (a.translation - b.translation).norm(); };
  for (int frame = 0; frame < 10; ++frame) place();
  constexpr int k_frames = 20;
  int stays = 0;
  Place before = place();
  for (int frame = 0; frame < k_frames; ++frame) {
    const Place after = place();
    EXPECT_GT(apart_m(after.estimated, before.estimated), 0);
    EXPECT_LT(apart_m(after.shown, after.estimated), 0.1_mm);
    stays += apart_m(after.shown, before.shown) == 0;
    before = after;
  }
  EXPECT_GE(stays, 0.7 * k_frames);
  moved.translation.x() += 0.4_mm;
  rig.move("prototype", moved);
  for (int frame = 0; frame < 10; ++frame) place();
  const Place then = place();
  EXPECT_LT(apart_m(then.shown, then.estimated), 0.1_mm);
  EXPECT_GT(apart_m(then.shown, before.shown), 0.2_mm);
}

// A track that was measured just now.
Track measured(const std::string& body, const Pose& world_from_body, Stamp at) {
  Track track;
  track.body = body;
  track.world_from_body = world_from_body;
  track.tracking = TrackingState::measured;
  track.captured_at = track.at = at;
  return track;
}

TEST(FrameComposer, OneProjectorPaintsTheSliceOnTheCardWhileTheSectionIsOn) {
  const sim::World world = test::studio_world(0.5);
  scene::Scene scene = *world.scene;
  scene::Volume volume;  // 0.4 m along each side, all white
  volume.size = {4, 4, 4};
  volume.values.assign(64, 1.0F);
  volume.part_from_voxel = Eigen::Translation3d(-0.15, -0.15, -0.15) * Eigen::Scaling(0.1);
  scene::Variant variant{"block", scene::volume_box(volume)};
  variant.volume = std::make_shared<const scene::Volume>(volume);
  variant.window = scene::GreyWindow{0, 1};
  scene.slots[0].variants = {variant};
  scene.section =
      scene::Section{.marker = {"aruco_4x4_50", "49"}, .size_m = 0.03, .slots = {scene.slots[0].name}};
  scene.section->card_size_m = Eigen::Vector2d(0.12, 0.09);
  // A card that faces the first projector, between it and the door.
  const Pose world_from_prototype = world.find("prototype")->world_from_object;
  const Imager& facing = world.rig.projectors[0];
  const Pose world_from_projector = facing.imager_from_world.inverse();
  const Eigen::Vector3d p_card = world_from_prototype.translation +
                                 0.2 * (world_from_projector.translation - world_from_prototype.translation);
  const Pose world_from_card(world_from_projector.rotation, p_card);

  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  FrameComposer composer = FrameComposer::create(scene, world.rig).value();
  scene::ShowState show_state = scene::initial_show_state(scene);
  show_state.slots[0].variant = "block";
  show_state.slots[0].pin = scene::Pin{world_from_prototype.inverse() * world_from_card, std::nullopt};
  show_state.section.is_on = true;
  const Percepts percepts;
  const auto lights = [&](double at_s) {
    const Stamp at = shifted(Stamp(), at_s);
    const ComposedFrame& frame = composer.compose({percepts,
                                                   show_state,
                                                   {at, at},
                                                   {measured("prototype", world_from_prototype, at),
                                                    measured(scene::section_body(), world_from_card, at)}});
    std::vector<cv::Vec3b> out;
    for (std::size_t i = 0; i < world.rig.projectors.size(); ++i) {
      const auto px = world.rig.projectors[i].project(world_from_card * Eigen::Vector3d(0.045, 0.03, 0));
      out.push_back(frame.projectors[i].at<cv::Vec3b>(
          cv::Point(static_cast<int>(std::lround(px->x())), static_cast<int>(std::lround(px->y())))));
    }
    return out;
  };
  const std::vector<cv::Vec3b> on = lights(1);
  EXPECT_EQ(on[0], cv::Vec3b::all(255));
  EXPECT_EQ(on[1], cv::Vec3b::all(0));
  show_state.slots[0].window = scene::GreyWindow{10, 1};
  EXPECT_EQ(lights(2)[0], cv::Vec3b::all(0));
  show_state.slots[0].window.reset();
  show_state.section.is_on = false;
  EXPECT_NE(lights(3)[0], cv::Vec3b::all(255));
}

}  // namespace
}  // namespace limn::session
