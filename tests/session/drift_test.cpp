// A camera or projector that was nudged during a session is detected by its light alone; hands must not be
// mistaken for it. LIMN_SOAK_S: seconds with hands (default 12; an hour is 3600).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>

#include "core/file.h"
#include "device/gl_context.h"
#include "session/frame_composer.h"
#include "session/perception.h"
#include "session/recording.h"
#include "session/requests/script.h"
#include "sim/virtual_rig.h"
#include "tests/support/matchers.h"
#include "tests/support/soak.h"
#include "tests/support/worlds.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double k_nudged_s = 3.5, k_hands_s = 3;

struct ReportedDrift {
  double at_s = 0;
  Drift drift;
};

// The drifts that a session in the studio reports during these events.
std::vector<ReportedDrift> found(const json& events, double seconds) {
  const fs::path file = test::test_folder() / "script.json";
  const json script = {{"schema", "limn.script/1"}, {"seconds", seconds}, {"events", events}};
  test::write_json(file, script);
  sim::World world = test::studio_world(0.34);
  const SessionSetup setup{world.rig, *world.scene, {}, {}};
  sim::VirtualRig rig(std::move(world), {.frame_period_s = 0.1, .grab_waits_for_light = false});
  ScriptedRoom room = ScriptedRoom::create(load_script(file).value(), &rig).value();
  const auto context = device::GlContext::create();
  EXPECT_TRUE(context) << context.message();
  Perception perception = Perception::create(setup.scene, setup.rig).value();
  FrameComposer composer = FrameComposer::create(setup.scene, setup.rig).value();
  const scene::ShowState show_state = scene::initial_show_state(setup.scene);
  std::vector<ReportedDrift> out;
  std::optional<Drift> before;
  while (rig.next_exposure() < shifted(Stamp{}, seconds)) {
    room.set(seconds_between(Stamp{}, rig.next_exposure()));
    const int camera = 0;
    const Percepts& percepts = perception.watch(rig.expose(std::span(&camera, 1)));
    const ComposedFrame& painted = composer.compose(
        frame_input(setup.scene, {}, percepts, show_state, {rig.now(), shifted(rig.now(), 0.033)}));
    for (std::size_t i = 0; i < painted.projectors.size(); ++i)
      EXPECT_TRUE(rig.projector(static_cast<int>(i)).show(painted.projectors[i]));
    composer.check_drift(percepts);
    if (composer.drift().has_value() == before.has_value()) continue;
    before = composer.drift();
    out.push_back({seconds_between(Stamp{}, percepts.captured_at), before.value_or(Drift{})});
    std::printf("%.1f s: %s\n", out.back().at_s, before ? sentence(*before).c_str() : "nothing");
  }
  return out;
}

json nudge(const std::string& device, const Eigen::Vector3d& degrees, double at_s = k_nudged_s) {
  return {{"at_s", at_s}, {"nudge", device}, {"degrees", {degrees.x(), degrees.y(), degrees.z()}}};
}

json hand(const std::string& what, const std::string& whose, double from_s, double until_s) {
  return {{"at_s", from_s}, {"until_s", until_s}, {what, whose}};
}

json sway(const std::string& marker, const Eigen::Vector3d& amplitude_m, double from_s, double until_s) {
  return {{"at_s", from_s},
          {"until_s", until_s},
          {"sway", marker},
          {"amplitude_m", {amplitude_m.x(), amplitude_m.y(), amplitude_m.z()}},
          {"hz", 1}};
}

// Hands are held into the light and a part is moved to and fro; then a device is nudged.
std::vector<ReportedDrift> found_after_hands(const json& nudge, double seconds) {
  return found({hand("block", "projector0", 0.5, k_hands_s), hand("cover", "aruco_4x4_50:1", 1, k_hands_s),
                sway("aruco_4x4_50:0", {0.02, 0, 0}, 1, 2.5), nudge},
               seconds);
}

void expect_named(const std::vector<ReportedDrift>& reported, const std::string& device) {
  ASSERT_EQ(reported.size(), 1u);
  EXPECT_GT(reported[0].at_s, k_nudged_s);
  EXPECT_LE(reported[0].at_s, k_nudged_s + 10);
  EXPECT_EQ(reported[0].drift.devices, std::vector{device});
}

TEST(Drift, AProjectorIsNamedUntilItStandsRightAgain) {
  json event = nudge("projector0", {0, 0.25, 0});
  event["until_s"] = 8;
  const auto reported = found_after_hands(event, 16);
  ASSERT_EQ(reported.size(), 2u);
  expect_named({reported[0]}, "projector0");
  EXPECT_GT(reported[1].at_s, 8);
}

// This projector's light has hardly any edge across its direction of motion.
TEST(Drift, TheOtherProjectorIsNamed) {
  expect_named(found_after_hands(nudge("projector1", {0, 0.25, 0}), 11), "projector1");
}

TEST(Drift, ACameraIsNamed) {
  expect_named(found_after_hands(nudge("camera0", {0.1, 0.15, 0}), 9), "camera0");
}

// Hands come into the light and onto markers and move parts, some at the same time and never long apart. The
// nudge after all of it must be found: this shows that the watch was active all the time.
TEST(Drift, HandsAreNone) {
  auto rng = test::test_rng();
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng);
  };
  const double seconds = test::soak_s(12, 12);
  json events;
  for (const std::string projector : {"projector0", "projector1"})
    for (double at_s = uniform(0.5, 4), until_s = 0; at_s < seconds; at_s = until_s + uniform(1, 8))
      events.push_back(hand("block", projector, at_s, until_s = at_s + uniform(0.3, 4)));
  for (const std::string marker : {"aruco_4x4_50:0", "aruco_4x4_50:1", "apriltag_36h11:2"})
    for (double at_s = uniform(0.5, 4), until_s = 0; at_s < seconds; at_s = until_s + uniform(2, 12))
      events.push_back(hand("cover", marker, at_s, until_s = at_s + uniform(0.3, 3)));
  for (double at_s = uniform(2, 6), until_s = 0; at_s < seconds; at_s = until_s + uniform(2, 15)) {
    until_s = at_s + std::round(uniform(1, 3));  // back at its place
    events.push_back(sway("aruco_4x4_50:0", {uniform(-0.03, 0.03), uniform(-0.03, 0.03), 0}, at_s, until_s));
  }
  const double nudged_s = seconds + 4;
  events.push_back(nudge("projector0", {0, 0.25, 0}, nudged_s));
  const auto reported = found(events, nudged_s + 10);
  ASSERT_EQ(reported.size(), 1u);
  EXPECT_GT(reported[0].at_s, nudged_s);
  const std::vector<std::string>& devices = reported[0].drift.devices;
  EXPECT_NE(std::find(devices.begin(), devices.end(), "projector0"), devices.end());
}

}  // namespace
}  // namespace limn::session
