#include "scene/show_state.h"

#include <gtest/gtest.h>

#include "core/file.h"
#include "scene/actions.h"
#include "tests/support/matchers.h"
#include "tests/support/tracks.h"

namespace limn::scene {
namespace {

using namespace test::literals;
using test::track_of;

Scene two_slots() {
  Scene scene;
  scene.prototype = Prototype{};
  for (const auto& [name, variants] :
       {std::pair<std::string, std::vector<std::string>>{"mirror", {"a", "b", "c"}}, {"trim", {"line"}}}) {
    Slot slot;
    slot.name = name;
    slot.marker = {"aruco_4x4_50", std::to_string(scene.slots.size())};
    slot.size_m = 0.04;
    for (const std::string& variant : variants) slot.variants.push_back({variant, {}});
    scene.slots.push_back(slot);
  }
  return scene;
}

const Pose k_world_from_prototype(exp_rotation({0.3, -0.2, 0.9}), {1, 2, 3});
const Pose k_prototype_from_marker(exp_rotation({0.1, 0.4, 0}), {0.1, 0.2, 0.05});

std::vector<Track> tracks_with(const Pose& prototype_from_marker) {
  return {track_of("prototype", k_world_from_prototype),
          track_of("mirror", k_world_from_prototype * prototype_from_marker)};
}

ShowState done(const Scene& scene, const ShowState& show_state, const PosedScene& posed, const Edit& edit) {
  auto result = apply_edit(scene, show_state, posed, edit);
  EXPECT_TRUE(result) << result.message();
  return result ? *result : show_state;
}

TEST(ShowState, VariantsGoRoundBothWays) {
  const Scene scene = two_slots();
  ShowState show_state = initial_show_state(scene);
  EXPECT_EQ(show_state.slots[0].variant, "a");
  show_state = done(scene, show_state, {}, {"previous_variant", "mirror", ""});
  EXPECT_EQ(show_state.slots[0].variant, "c");
  show_state = done(scene, show_state, {}, {"next_variant", "mirror", ""});
  show_state = done(scene, show_state, {}, {"next_variant", "mirror", ""});
  EXPECT_EQ(show_state.slots[0].variant, "b");
  show_state = done(scene, show_state, {}, {"choose_variant", "mirror", "a"});
  EXPECT_EQ(show_state.slots[0].variant, "a");
  EXPECT_EQ(show_state.slots[1].variant, "line");
}

TEST(ShowState, WhatCannotBeDoneIsNamedAndChangesNothing) {
  const Scene scene = two_slots();
  const ShowState show_state = initial_show_state(scene);
  for (const auto& [edit, part] : std::vector<std::pair<Edit, std::string>>{
           {{"dance", "", ""}, "expected an action (next_variant"},
           {{"next_variant", "grille", ""}, "expected a slot of the scene (mirror, trim), found 'grille'"},
           {{"choose_variant", "mirror", "z"}, "(a, b, c), found 'z'"},
           {{"nudge", "mirror", "1 2"}, "three numbers"},
           {{"nudge", "mirror", "1 2 nan"}, "three numbers"},
           {{"nudge", "mirror", "1 2 3 4"}, "three numbers"},
           {{"place", "mirror", "1 2 3"}, "and a quaternion w, x, y, z, found '1 2 3'"},
           {{"place", "mirror", "1 2 3 1 0 0 0 0"}, "x, y, z in millimetres"},
           {{"place", "mirror", "1 nan 3 1 0 0 0"}, "x, y, z in millimetres"},
           {{"place", "mirror", "5001 0 0 1 0 0 0"}, "at most 5000"},
           {{"place", "mirror", "1 2 3 0 0 0 0"}, "a quaternion of length 1, found length 0."},
           {{"place", "mirror", "1 2 3 0 0 9 0"}, "found length 9"},
           {{"save_look", "", "../x"}, "letters, digits"},
           {{"restore_look", "", "none"}, "found 'none'"},
           {{"next_look", "", ""}, "a saved look"},
           {{"blackout", "", "perhaps"}, "on, off or toggle"},
           {{"pair", "mirror", ""}, "Lay one down for a second"},
           {{"pair", "mirror", "nine"}, "pair: "},
           {{"pair", "mirror", "aruco_5x5_50:9"},
            "the scene's families (aruco_4x4_50), found aruco_5x5_50:9"},
           {{"pair", "mirror", "aruco_4x4_50:1"}, "found aruco_4x4_50:1, which slot 'trim' uses"},
           {{"units", "mirror", "a mm"}, "was dropped into slot 'mirror' (none)"},
           {{"units", "mirror", "a mile"},
            "expected m, cm, mm, in or ft after the part's name, found 'mile'"},
           {{"flip", "", ""}, "two looks shown before, found none"},
           {{"flip", "", "x"}, "flip: expected one of none, found 'x'"},
           {{"split", "", ""}, "expected a look shown before"},
           {{"split_at", "", "far"}, "a number of millimetres"},
           {{"split_at", "", "1e9"}, "a number of millimetres"},
           {{"material", "mirror", "red"}, "expected a colour (#c02818)"},
           {{"material", "mirror", "#c0281"}, "found '#c0281'"},
           {{"material", "mirror", "- 1.5"}, "from 0 to 1"},
           {{"material", "mirror", "- - nan"}, "from 0 to 1"},
           {{"material", "mirror", "- - - -"}, "each or '-'"},
           {{"light", "", "30 45 0.6 0.3"}, "expected five numbers"},
           {{"light", "", "30 45 0.6 0.3 -0.1"}, "(0 to 10)"},
           {{"light", "", "30 45 0.6 0.3 nan"}, "(0 to 10)"},
           {{"light", "", "30 450 0.6 0.3 0.1"}, "expected five numbers"},
           {{"light", "", "30 45 0.6 0.3 0.1 9"}, "expected five numbers"},
           {{"screen", "", "cinema"}, "rest, full, camera"},
           {{"screen", "wall", "full"}, "a screen of the devices file (none)"}}) {
    const auto result = apply_edit(scene, show_state, {}, edit);
    ASSERT_FALSE(result) << edit.action;
    EXPECT_NE(result.message().find(part), std::string::npos) << result.message();
  }
}

TEST(ShowState, EachScreenHasItsChoice) {
  const Scene scene = two_slots();
  ShowState show_state = initial_show_state(scene);
  show_state.screens = {{"wall"}, {"desk"}};
  show_state = done(scene, show_state, {}, {"screen", "wall", "full"});
  show_state = done(scene, show_state, {}, {"screen", "desk", "next"});
  show_state = done(scene, show_state, {}, {"screen", "desk", "next"});
  EXPECT_EQ(screen_content(show_state, "wall"), Screen::full);
  EXPECT_EQ(screen_content(show_state, "desk"), Screen::camera);
  EXPECT_EQ(screen_content(show_state, "another"), Screen::rest);
  EXPECT_EQ(show_state.screen, Screen::rest);
  show_state = done(scene, show_state, {}, {"screen", "", "view"});
  for (const char* name : {"wall", "desk", "another"})
    EXPECT_EQ(screen_content(show_state, name), Screen::view);
  EXPECT_FALSE(apply_edit(scene, show_state, {}, {"screen", "mirror", "full"}));
}

TEST(ShowState, APlacedPartStaysOnThePrototypeUntilItsMarkerIsMoved) {
  const Scene scene = two_slots();
  ShowState show_state = done(scene, initial_show_state(scene), {}, {"nudge", "mirror", "1 2 3"});
  show_state = done(scene, show_state, {}, {"place", "mirror", "120.5 -40 8 1.8 0 0 0"});
  const Pose placed(Eigen::Quaterniond::Identity(), {0.1205, -0.04, 0.008});
  const auto found = [&](const Pose& prototype_from_marker) {
    const std::vector<Track> tracks = tracks_with(prototype_from_marker);
    show_state = without_moved_pins(scene, show_state, tracks);
    return k_world_from_prototype.inverse() *
           compose_scene(scene, show_state, tracks).parts.at(0).world_from_part;
  };
  EXPECT_TRUE(test::pose_near(found(k_prototype_from_marker), placed, 1e-9, 1e-9));
  show_state = done(scene, show_state, {}, {"nudge", "mirror", "0 0 2"});
  EXPECT_NEAR(found(k_prototype_from_marker).translation.z(), 0.010, 1e-9);
  Pose moved = k_prototype_from_marker;
  moved.translation.x() += 0.02;
  EXPECT_GT((found(moved).translation - placed.translation).norm(), 0.05);
}

TEST(ShowState, ALookComesBackUntilItsMarkerIsMoved) {
  const Scene scene = two_slots();
  ShowState show_state = initial_show_state(scene);
  show_state = done(scene, show_state, {}, {"choose_variant", "mirror", "b"});
  show_state = done(scene, show_state, {}, {"nudge", "mirror", "1 -2 0.5"});
  const PosedScene saved = compose_scene(scene, show_state, tracks_with(k_prototype_from_marker));
  ASSERT_EQ(saved.parts.size(), 1u);
  show_state = done(scene, show_state, saved, {"save_look", "", "first"});
  EXPECT_EQ(show_state.look, "first");

  // The marker is moved, another variant is chosen, the prototype is moved; then the look is restored.
  show_state = done(scene, show_state, saved, {"choose_variant", "mirror", "c"});
  show_state = done(scene, show_state, saved, {"release", "mirror", ""});
  const Pose elsewhere(exp_rotation({0, 0, 1}), {-0.2, 0.1, 0});
  show_state = done(scene, show_state, saved, {"restore_look", "", "first"});
  const auto restored = [&](const Pose& marker) {
    show_state = without_moved_pins(scene, show_state, tracks_with(marker));
    return compose_scene(scene, show_state, tracks_with(marker)).parts.at(0);
  };
  const PosedPart at_once = restored(elsewhere);
  EXPECT_EQ(at_once.variant, "b");
  EXPECT_TRUE(test::pose_near(at_once.world_from_part, saved.parts[0].world_from_part, 1e-6_deg, 1e-6_mm));
  Pose nearby = elsewhere;
  nearby.translation.x() += 0.008;
  EXPECT_TRUE(
      test::pose_near(restored(nearby).world_from_part, saved.parts[0].world_from_part, 1e-6_deg, 1e-6_mm));
  Pose far = elsewhere;
  far.translation.x() += 0.012;
  EXPECT_TRUE(
      test::pose_near(restored(far).world_from_part, k_world_from_prototype * far, 1e-6_deg, 1e-6_mm));
  // A part whose marker is not seen has the pose that its look has.
  show_state = done(scene, show_state, saved, {"restore_look", "", "first"});
  const std::vector<Track> alone = {track_of("prototype", k_world_from_prototype)};
  show_state = without_moved_pins(scene, show_state, alone);
  EXPECT_EQ(compose_scene(scene, show_state, alone).parts.size(), 1u);
}

TEST(ShowState, LooksAreReadAsTheyWereWritten) {
  const Scene scene = two_slots();
  const Look look{"first", {{"mirror", "b", k_prototype_from_marker}}};
  const auto file = test::test_folder() / "first.json";
  ASSERT_TRUE(write_file(file, look_json(look)));
  const auto read = load_look(file, scene);
  ASSERT_TRUE(read) << read.message();
  ASSERT_EQ(read->parts.size(), 1u);
  EXPECT_EQ(read->parts[0].variant, "b");
  EXPECT_TRUE(
      test::pose_near(read->parts[0].prototype_from_part, k_prototype_from_marker, 1e-9_deg, 1e-9_mm));
  ASSERT_TRUE(write_file(file, look_json({"first", {{"mirror", "z", Pose{}}}})));
  const auto wrong = load_look(file, scene);
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.message().find("slots.mirror.variant"), std::string::npos) << wrong.message();
}

TEST(ShowState, APartIsCarriedByTheMarkerThatItIsPairedWith) {
  const Scene scene = two_slots();
  const MarkerName nine{"aruco_4x4_50", "9"};
  const Pose elsewhere(exp_rotation({0, 0, 1}), {-0.2, 0.1, 0});
  std::vector<Track> tracks = tracks_with(k_prototype_from_marker);
  tracks.push_back(track_of(loose_body(nine), elsewhere));
  const auto place = [&](const ShowState& show_state, const std::string& slot) {
    for (const PosedPart& part :
         compose_scene(scene, show_state, assign_tracks(scene, show_state, tracks)).parts)
      if (part.slot == slot) return part.world_from_part;
    return Pose(Eigen::Quaterniond::Identity(), {9, 9, 9});
  };
  const Pose own = k_world_from_prototype * k_prototype_from_marker;
  const ShowState at_first = initial_show_state(scene);
  EXPECT_TRUE(test::pose_near(place(at_first, "mirror"), own, 1e-9_deg, 1e-6_mm));
  const ShowState paired = done(scene, at_first, {}, {"pair", "mirror", nine.text()});
  EXPECT_TRUE(test::pose_near(place(paired, "mirror"), elsewhere, 1e-9_deg, 1e-6_mm));
  EXPECT_EQ(place(paired, "trim").translation.x(), 9);
  // The slot's own marker can now carry another slot; after that the slot cannot get it back.
  ShowState both = done(scene, paired, {}, {"pair", "trim", "aruco_4x4_50:0"});
  EXPECT_TRUE(test::pose_near(place(both, "trim"), own, 1e-9_deg, 1e-6_mm));
  EXPECT_TRUE(test::pose_near(place(both, "mirror"), elsewhere, 1e-9_deg, 1e-6_mm));
  EXPECT_FALSE(apply_edit(scene, both, {}, {"unpair", "mirror", ""}));
  // Two slots that have exchanged their markers are read from the file, too.
  both = done(scene, both, {}, {"pair", "mirror", "aruco_4x4_50:1"});
  const auto file = test::test_folder() / "pairings.json";
  ASSERT_TRUE(write_file(file, pairings_json(scene, both)));
  const auto read = with_pairings(file, scene, at_first);
  ASSERT_TRUE(read) << read.message();
  EXPECT_EQ(slot_marker(scene, *read, 0), scene.slots[1].marker);
  EXPECT_EQ(slot_marker(scene, *read, 1), scene.slots[0].marker);
  EXPECT_EQ(pairings_json(scene, done(scene, paired, {}, {"unpair", "mirror", ""})), "");
  for (const char* wrong : {"aruco_4x4_50:1", "aruco_6x6_50:1", "x"}) {
    ASSERT_TRUE(write_file(
        file, fmt::format(R"({{"schema": "limn.pairings/1", "slots": {{"mirror": "{}"}}}})", wrong)));
    const auto refused = with_pairings(file, scene, at_first);
    ASSERT_FALSE(refused) << wrong;
    EXPECT_NE(refused.message().find("slots.mirror"), std::string::npos) << refused.message();
  }
}

TEST(ShowState, TwoLooksAreFlippedAndSplit) {
  const Scene scene = two_slots();
  const PosedScene posed =
      compose_scene(scene, initial_show_state(scene), tracks_with(k_prototype_from_marker));
  ShowState show_state = done(scene, initial_show_state(scene), posed, {"save_look", "", "A"});
  show_state = done(scene, show_state, {}, {"choose_variant", "mirror", "b"});
  const PosedScene other = compose_scene(scene, show_state, tracks_with(k_prototype_from_marker));
  show_state = done(scene, show_state, other, {"save_look", "", "B"});
  EXPECT_FALSE(left_of_split(scene, show_state).has_value());
  show_state = done(scene, show_state, {}, {"split", "", "on"});
  ASSERT_TRUE(left_of_split(scene, show_state).has_value());
  EXPECT_EQ(left_of_split(scene, show_state)->slots[0].variant, "a");
  for (const char* variant : {"a", "b", "a"}) {
    show_state = done(scene, show_state, {}, {"flip", "", ""});
    EXPECT_EQ(show_state.slots[0].variant, variant);
    EXPECT_EQ(show_state.look, variant == std::string("a") ? "A" : "B");
    EXPECT_NE(left_of_split(scene, show_state)->slots[0].variant, variant);
  }
  show_state = done(scene, show_state, {}, {"delete_look", "", "B"});
  EXPECT_FALSE(apply_edit(scene, show_state, {}, {"flip", "", ""}));
  EXPECT_FALSE(show_state.split);
}

TEST(ShowState, ALookHoldsMaterialsAndLight) {
  const Scene scene = two_slots();
  const std::vector<Track> tracks = tracks_with(k_prototype_from_marker);
  const auto shown = [&](const ShowState& show_state) { return compose_scene(scene, show_state, tracks); };
  ShowState show_state = done(scene, initial_show_state(scene), {}, {"material", "mirror", "#ff0080 1 0.25"});
  show_state = done(scene, show_state, {}, {"light", "", "30 45 0.6 0.3 0.1"});
  const PosedScene posed = shown(show_state);
  ASSERT_EQ(posed.parts.size(), 1u);
  const MaterialOverride red = posed.parts[0].material;
  ASSERT_TRUE(red.base_colour && posed.light);
  EXPECT_NEAR((*red.base_colour - Eigen::Vector3d(1, 0, 0.21586)).norm(), 0, 1e-5);  // IEC 61966-2-1
  EXPECT_EQ(red.metallic, 1);
  EXPECT_EQ(red.roughness, 0.25);
  show_state = done(scene, show_state, posed, {"save_look", "", "red"});
  show_state = done(scene, show_state, posed, {"material", "mirror", "- - 0.5"});
  const MaterialOverride dull = shown(show_state).parts[0].material;
  EXPECT_FALSE(dull.base_colour || dull.metallic);
  EXPECT_EQ(dull.roughness, 0.5);
  show_state = done(scene, show_state, posed, {"material", "mirror", ""});
  show_state = done(scene, show_state, posed, {"light", "", ""});
  EXPECT_TRUE(shown(show_state).parts[0].material.is_none());
  EXPECT_FALSE(shown(show_state).light);
  show_state = done(scene, show_state, shown(show_state), {"save_look", "", "plain"});
  const ShowState again = done(scene, show_state, posed, {"restore_look", "", "red"});
  EXPECT_EQ(shown(again).parts[0].material, red);
  EXPECT_EQ(shown(again).light, posed.light);
  const ShowState plain = done(scene, again, posed, {"flip", "", ""});
  EXPECT_TRUE(shown(plain).parts[0].material.is_none());
  EXPECT_FALSE(shown(plain).light);
  // The look on the left of a split has its own materials.
  const auto left = left_of_split(scene, done(scene, plain, posed, {"split", "", "on"}));
  ASSERT_TRUE(left);
  EXPECT_EQ(shown(*left).parts[0].material, red);

  const auto file = std::filesystem::path(testing::TempDir()) / "materials.json";
  ASSERT_TRUE(write_file(file, look_json(show_state.looks[0])));
  const auto loaded = load_look(file, scene);
  ASSERT_TRUE(loaded) << loaded.message();
  EXPECT_EQ(loaded->parts[0].material, red);
  EXPECT_EQ(loaded->light, posed.light);
  const std::string old_one = look_json(show_state.looks[1]);
  EXPECT_EQ(old_one.find("material"), std::string::npos);
  EXPECT_EQ(old_one.find("light"), std::string::npos);
  for (const auto& [was, is, part] : std::vector<std::tuple<std::string, std::string, std::string>>{
           {"\"metallic\": 1.0", "\"metallic\": 1.5", "slots.mirror.material.metallic: expected 0 to 1"},
           {"\"metallic\"", "\"metal\"", "slots.mirror.material"},
           {"\"soft_below\"", "\"soft_under\"", "light"}}) {
    std::string text = look_json(show_state.looks[0]);
    ASSERT_NE(text.find(was), std::string::npos) << text;
    text.replace(text.find(was), was.size(), is);
    ASSERT_TRUE(write_file(file, text));
    const auto damaged = load_look(file, scene);
    ASSERT_FALSE(damaged);
    EXPECT_NE(damaged.message().find(part), std::string::npos) << damaged.message();
  }
}

// The lamp's direction is relative to somebody in front; the scene's light defines up if there is one.
TEST(ShowState, LightComesFromWhereItIsSaid) {
  Scene scene = two_slots();
  ShowState show_state = initial_show_state(scene);
  show_state.d_up_world = {0, -1, 0};  // the world frame is camera 0's
  show_state.d_front_world = {0, 0, -1};
  const auto lit = [&](const std::string& value) {
    return *done(scene, show_state, {}, {"light", "", value}).light;
  };
  const RoomLight right = lit("90 0 0.6 0.3 0.1");
  ASSERT_EQ(right.lamps.size(), 1u);
  EXPECT_NEAR((right.lamps[0].d_world - Eigen::Vector3d::UnitX()).norm(), 0, 1e-9);
  EXPECT_EQ(right.lamps[0].strength_rgb, Eigen::Vector3d::Constant(0.6));
  EXPECT_EQ(right.above_rgb, Eigen::Vector3d::Constant(0.3));
  EXPECT_EQ(right.below_rgb, Eigen::Vector3d::Constant(0.1));
  EXPECT_EQ(right.d_up_world, show_state.d_up_world);
  const double half = std::sqrt(0.5);
  EXPECT_NEAR((lit("0 45 1 0 0").lamps[0].d_world - Eigen::Vector3d(0, -half, -half)).norm(), 0, 1e-9);
  // Horizontal directions stay horizontal although the front direction points down by 30 degrees.
  const double c = std::cos(30_deg), s = std::sin(30_deg);
  scene.light = RoomLight{};
  scene.light->d_up_world = {0, -c, s};
  EXPECT_NEAR((lit("0 0 1 0 0").lamps[0].d_world - Eigen::Vector3d(0, -s, -c)).norm(), 0, 1e-9);
  // A look saves the scene's own light, too.
  show_state = done(scene, show_state, {}, {"save_look", "", "own"});
  EXPECT_EQ(show_state.looks[0].light, scene.light);
}

// Several edits may be done before the next frame is drawn.
TEST(ShowState, ALookHasTheEditsThatNoFrameHasShownYet) {
  const Scene scene = two_slots();
  const std::vector<Track> tracks = tracks_with(k_prototype_from_marker);
  const PosedScene posed = compose_scene(scene, initial_show_state(scene), tracks);
  ShowState show_state = done(scene, initial_show_state(scene), posed, {"save_look", "", "first"});
  show_state = done(scene, show_state, posed, {"choose_variant", "mirror", "b"});
  show_state = done(scene, show_state, posed, {"material", "mirror", "#ff0080 1 0.25"});
  show_state = done(scene, show_state, posed, {"light", "", "30 45 0.6 0.3 0.1"});
  const ShowState second = done(scene, show_state, posed, {"save_look", "", "second"});
  const Look& look = second.looks[1];
  ASSERT_EQ(look.parts.size(), 1u);
  EXPECT_EQ(look.parts[0].variant, "b");
  EXPECT_EQ(look.parts[0].material, show_state.slots[0].material);
  EXPECT_EQ(look.light, show_state.light);
  // A frozen picture is saved as it is seen.
  show_state = done(scene, show_state, posed, {"freeze", "", "on"});
  show_state = done(scene, show_state, posed, {"save_look", "", "third"});
  EXPECT_EQ(show_state.looks[1].parts[0].variant, "a");
  EXPECT_TRUE(show_state.looks[1].parts[0].material.is_none());
  // A part whose place is restored by a look, but was not shown.
  show_state = done(scene, second, {}, {"restore_look", "", "second"});
  show_state = done(scene, show_state, {}, {"save_look", "", "fourth"});
  ASSERT_EQ(show_state.looks[2].parts.size(), 1u);
  EXPECT_TRUE(
      limn::is_same(show_state.looks[2].parts[0].prototype_from_part, look.parts[0].prototype_from_part));
}

TEST(ShowState, BringsBackTheLookThatWasDeleted) {
  const Scene scene = two_slots();
  ShowState show_state = done(scene, initial_show_state(scene), {}, {"save_look", "", "A"});
  EXPECT_FALSE(apply_edit(scene, show_state, {}, {"undelete_look", "", ""}));
  const std::string text = look_json(show_state.looks[0]);
  show_state = done(scene, show_state, {}, {"delete_look", "", "A"});
  const ShowState again = done(scene, show_state, {}, {"undelete_look", "", ""});
  ASSERT_EQ(again.looks.size(), 1u);
  EXPECT_EQ(look_json(again.looks[0]), text);
  EXPECT_FALSE(apply_edit(scene, again, {}, {"undelete_look", "", ""}));
  show_state = done(scene, show_state, {}, {"save_look", "", "A"});  // replaces the look of that name
  EXPECT_FALSE(apply_edit(scene, show_state, {}, {"undelete_look", "", ""}));
}

TEST(ShowState, LooksWithoutANameAreCounted) {
  const Scene scene = two_slots();
  ShowState show_state = done(scene, initial_show_state(scene), {}, {"save_look", "", ""});
  EXPECT_EQ(show_state.look, "look-01");
  show_state = done(scene, show_state, {}, {"save_look", "", ""});
  EXPECT_EQ(show_state.look, "look-02");
}

}  // namespace
}  // namespace limn::scene
