// The section in a session: a marker held in the studio cuts parts, and covering it holds the plane.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>

#include "device/gl_context.h"
#include "session/requests/script.h"
#include "session/session.h"
#include "sim/virtual_rig.h"
#include "tests/session/studio.h"
#include "tests/support/matchers.h"

namespace limn::session {
namespace {

using nlohmann::json;
using scene::CutPlane;
namespace fs = std::filesystem;

constexpr const char* k_card = "apriltag_36h11:20";
constexpr double k_card_mm = 80;
// The card beside the mirror, tilted, as a person holds it.
const Pose k_world_from_card =
    Pose(Eigen::Quaterniond(std::sqrt(0.5), std::sqrt(0.5), 0, 0), {0, 0, 0.42}) *
    Pose(Eigen::Quaterniond(0, 1, 0, 0) * exp_rotation({-0.45, 0.5, 0.2}), {-0.05, 0.19, 0.1});

// How large and how frequent images are where a session has to be quick.
constexpr double k_small = 0.35, k_few_hz = 20;

// What a session shows of the cut, frame by frame.
struct Moment {
  double at_s = 0;
  std::optional<CutPlane> cut;                 // in the world
  Pose world_from_prototype, world_from_card;  // the true ones when the light arrives
  scene::SectionState state;
};

// Plays the studio with a card, which the events move and cover, in `hz` images of `resolution` in a second.
std::vector<Moment> played(const json& events, double seconds, double resolution, double hz) {
  const fs::path folder = test::test_folder();
  copy_studio_to(folder);
  json world_file = read_json(folder / "world.json"), scene_file = read_json(folder / "door/scene.json");
  scene_file["section"] = {{"marker", k_card}, {"size_mm", k_card_mm}};
  const Eigen::Quaterniond& q = k_world_from_card.rotation;
  const Eigen::Vector3d& t = k_world_from_card.translation;
  world_file["loose_markers"] = {
      {{"name", k_card},
       {"size_mm", k_card_mm},
       {"world_from_marker",
        {{"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}}, {"translation_m", {t.x(), t.y(), t.z()}}}}}};
  write_json(folder / "world.json", world_file);
  write_json(folder / "door/scene.json", scene_file);
  write_json(folder / "script.json", script_of(seconds, events));
  sim::World world = sim::load_world(folder / "world.json", tracker::marker_image).value();
  EXPECT_TRUE(scale_resolution(resolution, &world.rig).ok());
  const SessionSetup setup{world.rig, *world.scene, {}, {}};
  sim::VirtualRig rig(std::move(world),
                      {.frame_period_s = 1 / hz, .grab_waits_for_light = false, .follows_changes = true});
  ScriptedRoom room = ScriptedRoom::create(load_script(folder / "script.json").value(), &rig).value();
  const auto context = device::GlContext::create();
  EXPECT_TRUE(context) << context.message();
  Perception perception = Perception::create(setup.scene, setup.rig).value();
  Session session = Session::create(setup, nullptr, nullptr, false).value();
  std::vector<Moment> out;
  std::size_t edited = 0;
  while (rig.next_exposure() < shifted(Stamp{}, seconds)) {
    const double at_s = seconds_of(rig.next_exposure());
    room.set(at_s);
    const int camera = 0;
    session.update_percepts(perception.watch(rig.expose(std::span(&camera, 1))), out.size() + 1);
    const auto& edits = room.script().edits;
    for (; edited < edits.size() && edits[edited].at_s <= at_s; ++edited) {
      const Status done = session.edit(edits[edited].edit, "script", rig.now());
      EXPECT_TRUE(done.ok()) << done.message();
    }
    const Stamp shown_at = shifted(rig.now(), 0.04);
    const ComposedFrame& composed = session.compose(session.predict({rig.now(), shown_at}));
    out.push_back({at_s, composed.posed.cut, rig.world().world_from_prototype,
                   room.world_from_marker(MarkerName::parse(k_card).value(), seconds_of(shown_at)),
                   session.show_state().section});
  }
  return out;
}

// The largest distance (m) between two planes within the mirror's reach: 90 mm around its middle.
double distance_at_mirror(const Moment& moment, const CutPlane& a, const CutPlane& b) {
  const Eigen::Vector3d p_middle = moment.world_from_prototype * Eigen::Vector3d(-0.075, 0.17, 0.07);
  constexpr double k_reach_m = 0.09;
  return std::abs(height_over(a, p_middle) - height_over(b, p_middle)) +
         k_reach_m * (a.normal - b.normal).norm();
}

json edit_at(double at_s, const char* value) {
  return {{"at_s", at_s}, {"edit", {{"action", "section"}, {"value", value}}}};
}

TEST(Section, ThePlaneIsThatOfTheMarkerWithinHalfAMillimetre) {
  const std::vector<Moment> moments = played(json::array({edit_at(0, "on")}), 0.75, 0.6, 30);
  std::vector<double> mm;
  for (const Moment& moment : moments) {
    if (moment.at_s < 0.35) continue;  // the filter has settled
    ASSERT_TRUE(moment.cut) << moment.at_s;
    mm.push_back(1e3 * distance_at_mirror(moment, *moment.cut, scene::cut_plane(moment.world_from_card)));
  }
  ASSERT_GT(mm.size(), 10u);
  std::sort(mm.begin(), mm.end());
  std::printf("the cut plane over the mirror, from the marker's: %.2f mm (median), %.2f mm at most\n",
              mm[mm.size() / 2], mm.back());
  EXPECT_LE(mm.back(), 0.5);
}

TEST(Section, CoveringTheMarkerHoldsThePlaneAndCoveringItAgainReleasesIt) {
  // The hands of a script stay where the marker was at first, so that it goes back there to be covered again.
  const json moved = {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0.04, 0.02, 0.03}}},
             home = {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0, 0, 0}}};
  const std::vector<Moment> moments =
      played(json::array({edit_at(0, "on"),
                          {{"cover", k_card}, {"at_s", 0.6}, {"until_s", 1.4}},
                          {{"move", k_card}, {"at_s", 1.3}, {"home_from_marker", moved}},
                          {{"move", k_card}, {"at_s", 1.7}, {"home_from_marker", home}},
                          {{"cover", k_card}, {"at_s", 2.2}, {"until_s", 3.0}},
                          {{"move", k_card}, {"at_s", 3.0}, {"home_from_marker", moved}}}),
             3.5, k_small, k_few_hz);
  const auto at = [&](double at_s) -> const Moment& {
    return *std::find_if(moments.begin(), moments.end(), [&](const Moment& m) { return m.at_s >= at_s; });
  };
  const auto mm_between = [&](double a_s, double b_s) {
    EXPECT_TRUE(at(a_s).cut && at(b_s).cut) << a_s << ", " << b_s;
    return at(a_s).cut && at(b_s).cut ? 1e3 * distance_at_mirror(at(a_s), *at(a_s).cut, *at(b_s).cut) : 1e9;
  };
  EXPECT_FALSE(at(0.5).state.is_held);
  EXPECT_TRUE(at(1.6).state.is_held);   // covered for more than half a second
  EXPECT_LT(mm_between(0.5, 1.2), 2);   // while it is covered
  EXPECT_LT(mm_between(0.5, 1.6), 2);   // uncovered at another place
  EXPECT_FALSE(at(3.4).state.is_held);  // covered again
  EXPECT_LT(1e3 * distance_at_mirror(at(3.4), *at(3.4).cut, scene::cut_plane(at(3.4).world_from_card)), 2);
  EXPECT_GT(mm_between(0.5, 3.4), 15);
}

TEST(Section, AMarkerThatIsTakenAwayLeavesThePlaneAndHoldsNothing) {
  // It is carried sideways, out of the camera's view, and back again.
  const std::vector<Moment> moments = played(json::array({edit_at(0, "on"),
                                                          {{"sway", k_card},
                                                           {"at_s", 0.6},
                                                           {"until_s", 0.6 + 1 / 0.4},
                                                           {"amplitude_m", {1.2, 0, 0}},
                                                           {"hz", 0.2}}}),
                                             3.3, k_small, k_few_hz);
  for (const Moment& moment : moments) {
    EXPECT_FALSE(moment.state.is_held) << moment.at_s;
    if (moment.at_s > 0.4) {
      EXPECT_TRUE(moment.cut) << moment.at_s;
    }
  }
}

}  // namespace
}  // namespace limn::session
