// A camera or projector that was nudged during a session is noticed, by the light alone.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/coarser.h"
#include "apps/live/painter.h"
#include "apps/live/recording.h"
#include "apps/live/script.h"
#include "apps/live/watcher.h"
#include "apps/world_markers.h"
#include "core/file.h"
#include "device/gl_context.h"
#include "sim/virtual_rig.h"
#include "tests/support/matchers.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double k_nudged_s = 3.5, k_hands_s = 3;

struct Told {
  double at_s = 0;
  Drift drift;
};

// What a session in the studio finds moved. Before the nudge hands are held into the light and a part is
// moved to and fro.
std::vector<Told> found(const json& nudge, double seconds) {
  json events = {{{"at_s", 0.5}, {"until_s", k_hands_s}, {"block", "projector0"}},
                 {{"at_s", 1.0}, {"until_s", k_hands_s}, {"cover", "aruco_4x4_50:1"}},
                 {{"at_s", 1.0},
                  {"until_s", 2.5},
                  {"sway", "aruco_4x4_50:0"},
                  {"amplitude_m", {0.02, 0, 0}},
                  {"hz", 1}}};
  events.push_back(nudge);
  const fs::path file = test::test_folder() / "script.json";
  const json script = {{"schema", "limn.script/1"}, {"seconds", seconds}, {"events", events}};
  EXPECT_TRUE(write_file(file, script.dump()));
  sim::World world =
      sim::load_world(fs::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json", marker_picture).value();
  EXPECT_TRUE(make_coarser(0.34, &world.rig).ok());
  const SessionSetup setup{world.rig, *world.scene, {}, {}};
  sim::VirtualRig rig(std::move(world), {.frame_period_s = 0.1, .grab_waits_for_light = false});
  ScriptedRoom room = ScriptedRoom::create(load_script(file).value(), &rig).value();
  const auto context = device::GlContext::create();
  EXPECT_TRUE(context) << context.message();
  Watcher watcher = Watcher::create(setup.scene, setup.rig).value();
  Painter painter = Painter::create(setup.scene, setup.rig).value();
  const scene::Staging staging = scene::first_staging(setup.scene);
  std::vector<Told> out;
  std::optional<Drift> before;
  while (rig.next_exposure() < shifted(Stamp{}, seconds)) {
    room.set(seconds_between(Stamp{}, rig.next_exposure()));
    const int camera = 0;
    const Watched& watched = watcher.watch(rig.expose(std::span(&camera, 1)));
    const Painted& painted = painter.paint(watched, staging, rig.now(), shifted(rig.now(), 0.033));
    for (std::size_t i = 0; i < painted.projectors.size(); ++i)
      EXPECT_TRUE(rig.projector(static_cast<int>(i)).show(painted.projectors[i]));
    painter.look_for_drift(watched);
    if (painter.drift().has_value() == before.has_value()) continue;
    before = painter.drift();
    out.push_back({seconds_between(Stamp{}, watched.captured_at), before.value_or(Drift{})});
    std::printf("%.1f s: %s\n", out.back().at_s, before ? sentence(*before).c_str() : "nothing");
  }
  return out;
}

json nudge(const std::string& device, const Eigen::Vector3d& degrees) {
  return {{"at_s", k_nudged_s}, {"nudge", device}, {"degrees", {degrees.x(), degrees.y(), degrees.z()}}};
}

void expect_named(const std::vector<Told>& told, const std::string& device) {
  ASSERT_EQ(told.size(), 1u);
  EXPECT_GT(told[0].at_s, k_nudged_s);
  EXPECT_LE(told[0].at_s, k_nudged_s + 10);
  EXPECT_EQ(told[0].drift.devices, std::vector{device});
}

TEST(Drift, AProjectorIsNamedUntilItStandsRightAgain) {
  json event = nudge("projector0", {0, 0.25, 0});
  event["until_s"] = 8;
  const auto told = found(event, 16);
  ASSERT_EQ(told.size(), 2u);
  expect_named({told[0]}, "projector0");
  EXPECT_GT(told[1].at_s, 8);
}

// Its light has hardly any edge across the way in which it moved.
TEST(Drift, TheOtherProjectorIsNamed) {
  expect_named(found(nudge("projector1", {0, 0.25, 0}), 11), "projector1");
}

TEST(Drift, ACameraIsNamed) { expect_named(found(nudge("camera0", {0.1, 0.15, 0}), 9), "camera0"); }

}  // namespace
}  // namespace limn::apps
