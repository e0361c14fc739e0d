#include "scene/staging.h"

#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using namespace test::literals;

Scene two_slots() {
  Scene scene;
  scene.prototype = Prototype{};
  for (const auto& [name, variants] :
       {std::pair<std::string, std::vector<std::string>>{"mirror", {"a", "b", "c"}}, {"trim", {"line"}}}) {
    Slot slot;
    slot.name = name;
    for (const std::string& variant : variants) slot.variants.push_back({variant, {}});
    scene.slots.push_back(slot);
  }
  return scene;
}

Track track_of(const std::string& body, const Pose& world_from_body) {
  Track track;
  track.body = body;
  track.world_from_body = world_from_body;
  return track;
}

const Pose k_world_from_prototype(exp_rotation({0.3, -0.2, 0.9}), {1, 2, 3});
const Pose k_prototype_from_marker(exp_rotation({0.1, 0.4, 0}), {0.1, 0.2, 0.05});

std::vector<Track> tracks_with(const Pose& prototype_from_marker) {
  return {track_of("prototype", k_world_from_prototype),
          track_of("mirror", k_world_from_prototype * prototype_from_marker)};
}

Staging done(const Scene& scene, const Staging& staging, const PosedScene& posed, const Edit& edit) {
  auto result = edited(scene, staging, posed, edit);
  EXPECT_TRUE(result) << result.message();
  return result ? *result : staging;
}

TEST(Staging, VariantsGoRoundBothWays) {
  const Scene scene = two_slots();
  Staging staging = first_staging(scene);
  EXPECT_EQ(staging.slots[0].variant, "a");
  staging = done(scene, staging, {}, {"previous_variant", "mirror", ""});
  EXPECT_EQ(staging.slots[0].variant, "c");
  staging = done(scene, staging, {}, {"next_variant", "mirror", ""});
  staging = done(scene, staging, {}, {"next_variant", "mirror", ""});
  EXPECT_EQ(staging.slots[0].variant, "b");
  staging = done(scene, staging, {}, {"choose_variant", "mirror", "a"});
  EXPECT_EQ(staging.slots[0].variant, "a");
  EXPECT_EQ(staging.slots[1].variant, "line");
}

TEST(Staging, WhatCannotBeDoneIsNamedAndChangesNothing) {
  const Scene scene = two_slots();
  const Staging staging = first_staging(scene);
  for (const auto& [edit, part] : std::vector<std::pair<Edit, std::string>>{
           {{"dance", "", ""}, "expected an action (next_variant"},
           {{"next_variant", "grille", ""}, "expected a slot of the scene (mirror, trim), found 'grille'"},
           {{"choose_variant", "mirror", "z"}, "(a, b, c), found 'z'"},
           {{"nudge", "mirror", "1 2"}, "three numbers"},
           {{"nudge", "mirror", "1 2 nan"}, "three numbers"},
           {{"nudge", "mirror", "1 2 3 4"}, "three numbers"},
           {{"save_look", "", "../x"}, "letters, digits"},
           {{"restore_look", "", "none"}, "found 'none'"},
           {{"next_look", "", ""}, "a saved look"},
           {{"blackout", "", "perhaps"}, "on, off or toggle"},
           {{"screen", "", "cinema"}, "rest, full, camera"}}) {
    const auto result = edited(scene, staging, {}, edit);
    ASSERT_FALSE(result) << edit.action;
    EXPECT_NE(result.message().find(part), std::string::npos) << result.message();
  }
}

TEST(Staging, ALookComesBackUntilItsMarkerIsMoved) {
  const Scene scene = two_slots();
  Staging staging = first_staging(scene);
  staging = done(scene, staging, {}, {"choose_variant", "mirror", "b"});
  staging = done(scene, staging, {}, {"nudge", "mirror", "1 -2 0.5"});
  const PosedScene saved = staged(scene, staging, tracks_with(k_prototype_from_marker));
  ASSERT_EQ(saved.parts.size(), 1u);
  staging = done(scene, staging, saved, {"save_look", "", "first"});
  EXPECT_EQ(staging.look, "first");

  // The marker goes elsewhere, another variant is chosen, the prototype is moved; then the look comes back.
  staging = done(scene, staging, saved, {"choose_variant", "mirror", "c"});
  staging = done(scene, staging, saved, {"release", "mirror", ""});
  const Pose elsewhere(exp_rotation({0, 0, 1}), {-0.2, 0.1, 0});
  staging = done(scene, staging, saved, {"restore_look", "", "first"});
  const auto restored = [&](const Pose& marker) {
    staging = unpinned(scene, staging, tracks_with(marker));
    return staged(scene, staging, tracks_with(marker)).parts.at(0);
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
  // A part whose marker is out of sight stands where its look had it.
  staging = done(scene, staging, saved, {"restore_look", "", "first"});
  const std::vector<Track> alone = {track_of("prototype", k_world_from_prototype)};
  staging = unpinned(scene, staging, alone);
  EXPECT_EQ(staged(scene, staging, alone).parts.size(), 1u);
}

TEST(Staging, LooksAreReadAsTheyWereWritten) {
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

TEST(Staging, EveryActionCanBeDone) {
  const Scene scene = two_slots();
  Staging staging = done(scene, first_staging(scene), {}, {"save_look", "", ""});
  EXPECT_EQ(staging.look, "look-01");
  for (const Action& action : actions()) {
    std::string value;
    if (action.name == "choose_variant") value = "c";
    if (action.name == "nudge") value = "0 0 1";
    if (action.name == "restore_look" || action.name == "delete_look") value = "look-01";
    const auto result = edited(scene, staging, {}, {action.name, action.of_slot ? "mirror" : "", value});
    EXPECT_TRUE(result) << action.name << ": " << result.message();
  }
}

}  // namespace
}  // namespace limn::scene
