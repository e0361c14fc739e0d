#include "session/frame_composer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <span>

#include "device/gl_context.h"
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

}  // namespace
}  // namespace limn::session
