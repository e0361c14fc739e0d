// The section: the scene file, its state, looks, and the plane that a posed scene has.
#include "scene/section.h"

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/file.h"
#include "scene/actions.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "tests/support/matchers.h"
#include "tests/support/tracks.h"

namespace limn::scene {
namespace {

using nlohmann::json;
using test::track_of;
namespace fs = std::filesystem;

constexpr double k_exact = 1e-12;

json slot_of(const char* name, const char* marker) {
  return {{"name", name},
          {"marker", marker},
          {"size_mm", 40},
          {"marker_from_part", {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0, 0, 0}}}},
          {"variants", {{{"name", "a"}, {"mesh", "clay.obj"}, {"units", "m"}}}}};
}

json cut_scene() {
  return {{"schema", "limn.scene/1"},
          {"prototype", {{"mesh", "clay.obj"}, {"units", "m"}}},
          {"slots", {slot_of("mirror", "aruco_4x4_50:0"), slot_of("trim", "aruco_4x4_50:1")}},
          {"controls", {{{"marker", "aruco_4x4_50:5"}, {"action", "section"}}}},
          {"section",
           {{"marker", "aruco_4x4_50:7"},
            {"size_mm", 60},
            {"marker_from_plane", {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0, 0, 0.002}}}},
            {"slots", {"trim"}},
            {"cuts_prototype", false},
            {"hatch_mm", 3},
            {"cap_colour", {1, 0.5, 0.25}}}}};
}

Result<Scene> loaded(const json& scene) {
  const fs::path folder = test::test_folder();
  EXPECT_TRUE(write_file(folder / "scene.json", scene.dump()));
  EXPECT_TRUE(write_file(folder / "clay.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  return load_scene(folder);
}

ShowState done(const Scene& scene, const ShowState& show_state, const std::string& value) {
  const auto after = apply_edit(scene, show_state, {}, make_edit(ActionId::section, "", value));
  EXPECT_TRUE(after) << after.message();
  return after ? *after : show_state;
}

const Pose k_world_from_prototype(exp_rotation({0.3, -0.2, 0.9}), {1, 2, 3});
const Pose k_prototype_from_marker(exp_rotation({0.1, 0.4, 0}), {0.1, 0.2, 0.05});

Track section_track(const Pose& world_from_marker, TrackingState tracking = TrackingState::measured) {
  Track track = track_of(section_body(), world_from_marker);
  track.tracking = tracking;
  return track;
}

// The cut in the prototype's frame.
std::optional<CutPlane> cut_on_prototype(const PosedScene& posed) {
  if (!posed.cut) return std::nullopt;
  return transformed(posed.world_from_prototype->inverse(), *posed.cut);
}

testing::AssertionResult is_near(const std::optional<CutPlane>& found, const CutPlane& wanted, double limit) {
  if (!found) return testing::AssertionFailure() << "nothing is cut";
  if ((found->normal - wanted.normal).norm() < limit && std::abs(found->offset_m - wanted.offset_m) < limit)
    return testing::AssertionSuccess();
  return testing::AssertionFailure() << found->normal.transpose() << ", " << found->offset_m << "; wanted "
                                     << wanted.normal.transpose() << ", " << wanted.offset_m;
}

TEST(Section, ThePlaneIsThatOfTheMarkerAndItsFrontIsRemoved) {
  const Pose a_from_marker(exp_rotation({0.2, -0.7, 1.1}), {0.3, -0.1, 0.6});
  const CutPlane plane = cut_plane(a_from_marker);
  EXPECT_TRUE(is_plane(plane));
  EXPECT_NEAR(height_over(plane, a_from_marker * Eigen::Vector3d(0.02, -0.4, 0)), 0, k_exact);
  EXPECT_NEAR(height_over(plane, a_from_marker * Eigen::Vector3d(0.1, 0, -0.03)), 0.03, k_exact);
  EXPECT_NEAR(height_over(flipped(plane), a_from_marker * Eigen::Vector3d(0.1, 0, -0.03)), -0.03, k_exact);
  const Pose b_from_a(exp_rotation({1.2, 0.1, -0.4}), {-0.2, 0.9, 0.1});
  EXPECT_TRUE(is_near(transformed(b_from_a, plane), cut_plane(b_from_a * a_from_marker), k_exact));
}

TEST(Section, LinesStayInThePartWhileThePlaneIsShiftedAndDifferFromPartToPart) {
  for (const Eigen::Vector3d& n : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0.36, 0.48, 0.8),
                                   Eigen::Vector3d(-0.6, 0.8, 0), Eigen::Vector3d(0, -1, 0)}) {
    for (int owner = 0; owner < 6; ++owner) {
      const Eigen::Vector3d across = across_hatch(n, owner);
      EXPECT_NEAR(across.norm(), 1, k_exact);
      EXPECT_NEAR(across.dot(n), 0, k_exact);
      for (int other = 0; other < owner; ++other)  // at least 30 degrees apart, as lines without a sense
        EXPECT_LT(std::abs(across.dot(across_hatch(n, other))), std::cos(std::numbers::pi / 6) + 1e-9);
    }
  }
}

TEST(Section, EveryKeyIsRead) {
  const auto scene = loaded(cut_scene());
  ASSERT_TRUE(scene) << scene.message();
  ASSERT_TRUE(scene->section);
  EXPECT_EQ(scene->section->marker.text(), "aruco_4x4_50:7");
  EXPECT_EQ(scene->section->size_m, 0.06);
  EXPECT_EQ(scene->section->marker_from_plane.translation.z(), 0.002);
  EXPECT_TRUE(scene->section->cuts("trim") && !scene->section->cuts("mirror"));
  EXPECT_FALSE(scene->section->cuts_prototype);
  EXPECT_EQ(scene->section->hatch_m, 0.003);
  EXPECT_EQ(scene->section->cap_colour, Eigen::Vector3d(1, 0.5, 0.25));
  EXPECT_EQ(bodies(*scene).back().name, section_body());
  // Its marker is a control, too.
  ASSERT_EQ(scene->controls.size(), 2u);
  EXPECT_EQ(scene->controls[1].marker, scene->section->marker);
  EXPECT_EQ(scene->controls[1].value, "cover");

  json usual = cut_scene();
  usual["section"] = {{"marker", "aruco_4x4_50:7"}, {"size_mm", 40}};
  const auto all = loaded(usual);
  ASSERT_TRUE(all) << all.message();
  EXPECT_TRUE(all->section->cuts("trim") && all->section->cuts("mirror") && all->section->cuts_prototype);
}

TEST(Section, WhatIsWrongIsNamed) {
  const auto expect = [](const char* key, const json& value, const char* words) {
    json scene = cut_scene();
    scene["section"][key] = value;
    const auto found = loaded(scene);
    const std::string message = found ? "(no error)" : found.message();
    EXPECT_NE(message.find(words), std::string::npos) << words << " in: " << message;
  };
  expect("slots", {"grille"},
         "section.slots[0]: expected a slot of the scene (mirror, trim), found 'grille'");
  expect("marker", "aruco_4x4_50:1", "which slots[1].marker uses already");
  expect("marker", "aruco_4x4_50:5", "which a control uses");
  expect("marker", "nine", "section.marker");
  expect("marker", "constellation:wand.json", "expected a square marker for the section");
  expect("size_mm", 0, "section.size_mm");
  expect("hatch_mm", -1, "section.hatch_mm");
  expect("cap_colour", {2, 0, 0}, "linear light from 0 to 1");
  expect("colour", {1, 0, 0}, "colour");
  json scene = cut_scene();
  scene["section"].erase("size_mm");
  EXPECT_NE(loaded(scene).message().find("section.size_mm"), std::string::npos);
}

TEST(Section, ThePlaneFollowsItsMarkerAndStaysWhenItIsNotSeen) {
  const Scene scene = loaded(cut_scene()).value();
  ShowState show_state = initial_show_state(scene);
  const auto shown = [&](const std::vector<Track>& tracks) {
    show_state = with_section_seen(scene, show_state, tracks);
    return cut_on_prototype(compose_scene(scene, show_state, tracks));
  };
  const Track prototype = track_of("prototype", k_world_from_prototype);
  const auto marker_at = [&](const Pose& pose) { return section_track(k_world_from_prototype * pose); };
  const auto plane_at = [&](const Pose& pose) { return cut_plane(pose * scene.section->marker_from_plane); };
  EXPECT_FALSE(shown({prototype, marker_at(k_prototype_from_marker)}));  // it is off at first

  show_state = done(scene, show_state, "on");
  EXPECT_FALSE(shown({prototype}));
  EXPECT_TRUE(is_near(shown({prototype, marker_at(k_prototype_from_marker)}),
                      plane_at(k_prototype_from_marker), k_exact));
  const Pose moved = Pose(exp_rotation({0.5, 0, 0.2}), {0, 0.1, -0.02}) * k_prototype_from_marker;
  EXPECT_TRUE(is_near(shown({prototype, marker_at(moved)}), plane_at(moved), k_exact));

  // Out of view: the last plane stays, in the prototype.
  const Track carried = track_of("prototype", Pose(exp_rotation({0, 0.4, 0}), {2, 0, 1}));
  EXPECT_TRUE(is_near(shown({carried}), plane_at(moved), k_exact));
  Track old = marker_at(Pose());
  old.tracking = TrackingState::extrapolated;
  old.at = old.captured_at + std::chrono::milliseconds(300);
  EXPECT_TRUE(is_near(shown({prototype, old}), plane_at(moved), k_exact));
  EXPECT_TRUE(
      is_near(shown({prototype, section_track(Pose(), TrackingState::lost)}), plane_at(moved), k_exact));

  // Held: another place of the marker changes nothing, until it is released.
  show_state = done(scene, show_state, "cover");
  EXPECT_TRUE(is_near(shown({prototype, marker_at(k_prototype_from_marker)}), plane_at(moved), k_exact));
  EXPECT_TRUE(is_near(shown({carried}), plane_at(moved), k_exact));
  show_state = done(scene, show_state, "cover");
  EXPECT_TRUE(is_near(shown({prototype, marker_at(k_prototype_from_marker)}),
                      plane_at(k_prototype_from_marker), k_exact));

  show_state = done(scene, show_state, "flip");
  EXPECT_TRUE(is_near(shown({prototype}), flipped(plane_at(k_prototype_from_marker)), k_exact));
  EXPECT_TRUE(is_near(shown({prototype, marker_at(moved)}), flipped(plane_at(moved)), k_exact));
  show_state = done(scene, show_state, "off");
  EXPECT_FALSE(shown({prototype, marker_at(moved)}));
}

TEST(Section, ALookKeepsTheCutAndOlderLooksAreWhole) {
  const Scene scene = loaded(cut_scene()).value();
  ShowState show_state = done(scene, initial_show_state(scene), "on");
  const std::vector<Track> tracks = {track_of("prototype", k_world_from_prototype),
                                     section_track(k_world_from_prototype * k_prototype_from_marker)};
  show_state = with_section_seen(scene, show_state, tracks);
  const PosedScene posed = compose_scene(scene, show_state, tracks);
  show_state = apply_edit(scene, show_state, posed, {"save_look", "", "cut"}).value();
  ASSERT_TRUE(show_state.looks[0].cut);
  const fs::path file = test::test_folder() / "look.json";
  ASSERT_TRUE(write_file(file, look_json(show_state.looks[0])));
  const auto read = load_look(file, scene);
  ASSERT_TRUE(read) << read.message();
  const CutPlane plane = cut_plane(k_prototype_from_marker * scene.section->marker_from_plane);
  EXPECT_TRUE(is_near(read->cut, plane, 1e-9));

  const ShowState restored = with_look(scene, initial_show_state(scene), *read);
  EXPECT_TRUE(restored.section.is_on && restored.section.is_held);
  const std::vector<Track> elsewhere = {track_of("prototype", Pose())};
  EXPECT_TRUE(is_near(cut_on_prototype(compose_scene(scene, restored, elsewhere)), plane, 1e-9));

  ASSERT_TRUE(write_file(file, R"({"schema": "limn.look/1", "name": "old", "slots": {}})"));
  const auto old = load_look(file, scene);
  ASSERT_TRUE(old) << old.message();
  EXPECT_FALSE(compose_scene(scene, with_look(scene, restored, *old), tracks).cut);
  for (const char* wrong : {R"({"normal": [0, 0, 0], "offset_mm": 1})", R"({"normal": [0, 0, 1]})",
                            R"({"normal": [0, 0, 1], "offset_mm": 1e9})"}) {
    ASSERT_TRUE(write_file(
        file, std::string(R"({"schema": "limn.look/1", "name": "x", "slots": {}, "cut": )") + wrong + "}"));
    EXPECT_FALSE(load_look(file, scene)) << wrong;
  }
}

TEST(Section, TheActionNeedsASection) {
  Scene scene = loaded(cut_scene()).value();
  const ShowState show_state = initial_show_state(scene);
  const auto wrong = apply_edit(scene, show_state, {}, make_edit(ActionId::section, "", "open"));
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.message().find("expected one of toggle, on, off, hold"), std::string::npos);
  EXPECT_EQ(done(scene, show_state, "").section.is_on, true);
  scene.section.reset();
  const auto none = apply_edit(scene, show_state, {}, make_edit(ActionId::section));
  ASSERT_FALSE(none);
  EXPECT_NE(none.message().find("expected a scene with a section"), std::string::npos);
}

}  // namespace
}  // namespace limn::scene
