// Tests of the table of actions and of each action.
#include "scene/actions.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "core/names.h"

namespace limn::scene {
namespace {

constexpr double k_exact = 1e-12;

// A prototype, a slot with three variants and an auto-imported one, and another slot.
Scene a_scene() {
  Scene scene;
  scene.prototype = Prototype{};
  scene.prototype->mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  scene.prototype->mesh.triangles = {{0, 1, 2}};
  for (const char* name : {"mirror", "trim"}) {
    Slot slot;
    slot.name = name;
    slot.marker = {"aruco_4x4_50", std::to_string(scene.slots.size())};
    slot.size_m = 0.04;
    for (const char* variant : {"a", "b", "c"}) slot.variants.push_back({variant, {}});
    scene.slots.push_back(slot);
  }
  scene.finishes.emplace_back();
  scene.finishes[0].name = "sand";
  scene.section = Section{.marker = {"aruco_4x4_50", "8"}, .size_m = 0.04, .slots = {"mirror"}};
  scene.lines.emplace_back();
  scene.lines[0].name = "every 50";
  scene.lines[0].is_shown = false;
  scene.slots[0].variants[0].volume = std::make_shared<Volume>();
  Mesh& mesh = scene.prototype->mesh;
  for (const auto& [x, y] : {std::pair(-1.0F, -1.0F), {1.0F, -1.0F}, {0.0F, 1.0F}}) {
    mesh.positions.emplace_back(x, y, 0.0F);
    mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
  }
  mesh.triangles = {{0, 1, 2}};
  scene.drape = std::make_shared<const Drape>(mesh);
  scene.slots[0].variants.push_back({"new one", {}, Variant::AutoImported{LengthUnit::metre}});
  return scene;
}

Look look_of(const std::string& name, const std::string& variant) {
  Look look{name, {{"mirror", variant, Pose(Eigen::Quaterniond::Identity(), {1, 0, 0})}}};
  look.light = RoomLight{};
  return look;
}

// A show state with looks A, B and C (B was shown last, A before it) and one deleted look.
ShowState a_staging(const Scene& scene) {
  ShowState show_state = initial_show_state(scene);
  show_state.looks = {look_of("A", "a"), look_of("B", "b"), look_of("C", "c")};
  show_state.look = "B";
  show_state.other_look = "A";
  show_state.deleted_look = look_of("gone", "a");
  show_state.slots[0].variant = "b";
  show_state.screens = {{"wall"}, {"desk"}};
  const Eigen::Vector3d d(0, 0, 1);
  show_state.drawn = {{"stroke", {}, {{{{0, 0, 0}, d}, {{0.05, 0, 0}, d}, {{0.1, 0, 0}, d}}, false}}};
  return show_state;
}

std::string text_of(const Pose& pose) {
  const Eigen::Vector3d& t = pose.translation;
  const Eigen::Quaterniond& q = pose.rotation;
  return fmt::format("{} {} {} {} {} {} {}", t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z());
}

std::string drawn_text(const std::vector<DrawnLine>& drawn) {
  std::string text;
  for (const DrawnLine& line : drawn) {
    text += line.name + ": ";
    for (const SurfacePoint& point : line.curve.points)
      text += text_of(Pose(Eigen::Quaterniond::Identity(), point.p));
  }
  return text;
}

// All members of a show state, as text. A new member causes a compiler error until it is added here, too.
std::map<std::string, std::string> members_of(const ShowState& show_state) {
  const auto& [slots, looks, look, other_look, deleted_look, blackout, frozen, marker_states, grid, split,
               split_mm, screen, screens, light, finish, section, lines, drawn, deviation, d_up_world,
               d_front_world, viewer] = show_state;
  std::map<std::string, std::string> all = {
      {"look", look},
      {"other_look", other_look},
      {"deleted_look", deleted_look ? look_json(*deleted_look) : ""},
      {"blackout", fmt::format("{}", blackout)},
      {"frozen", fmt::format("{}", frozen)},
      {"marker_states", fmt::format("{}", marker_states)},
      {"grid", fmt::format("{}", grid)},
      {"split", fmt::format("{}", split)},
      {"split_mm", fmt::format("{}", split_mm)},
      {"screen", screen_names()[static_cast<std::size_t>(screen)]},
      {"light", light ? look_json({"light", {}, light}) : ""},
      {"d_up_world", text_of(Pose(Eigen::Quaterniond::Identity(), d_up_world))},
      {"d_front_world", text_of(Pose(Eigen::Quaterniond::Identity(), d_front_world))},
      {"finish", finish},
      {"section", fmt::format("{} {} {} {}", section.is_on, section.is_held, section.is_flipped,
                              look_json({.name = "", .parts = {}, .cut = section.plane}))},
      {"lines", joined_names(lines)},
      {"deviation",
       fmt::format(
           "{} {} {} {} {}", deviation.layer != nullptr, deviation.is_shown, deviation.is_held,
           deviation.fit_box ? text_of(Pose(Eigen::Quaterniond::Identity(), deviation.fit_box->max())) : "",
           deviation.tolerance_m)},
      {"drawn", drawn_text(drawn)},
      {"viewer", viewer}};
  for (const Look& each : looks) all["looks"] += look_json(each);
  for (const Output& each : screens)
    all["screens"] += each.name + " " + screen_names()[static_cast<std::size_t>(each.shows)] + "; ";
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const auto& [variant, nudge, pin, marker, material, window] = slots[i];
    const std::string slot = fmt::format("slots[{}].", i);
    all[slot + "variant"] = variant;
    all[slot + "nudge"] = text_of(Pose(Eigen::Quaterniond::Identity(), nudge));
    all[slot + "pin"] = pin ? text_of(pin->prototype_from_part) : "";
    all[slot + "marker"] = marker ? marker->text() : "";
    all[slot + "material"] = look_json({"material", {{"", "", Pose{}, material}}});
    all[slot + "window"] = window ? fmt::format("{} {}", window->width, window->level) : "";
  }
  return all;
}

using Members = std::set<std::string>;

Members changed(const ShowState& before, const ShowState& after) {
  Members out;
  const std::map<std::string, std::string> was = members_of(before);
  for (const auto& [member, text] : members_of(after))
    if (!was.contains(member) || was.at(member) != text) out.insert(member);
  for (const auto& [member, text] : was)
    if (!members_of(after).contains(member)) out.insert(member);
  return out;
}

// A test case of an action: the show state before, the value, the members that must change, and the condition
// that must then hold.
struct Case {
  ShowState before;
  std::string value;
  Members members;
  bool (*is_done)(const ShowState& after);
  std::string slot = "mirror";  // only for an action on a slot
};

// The switch has no default: an action without a case gives a warning here and a failure below.
std::optional<Case> case_of(ActionId id, const Scene& scene) {
  const ShowState usual = a_staging(scene);
  ShowState held = usual;
  held.slots[0].nudge = {0.1, 0.2, 0.3};
  held.slots[0].pin = Pin{Pose{}, std::nullopt};
  held.slots[0].marker = MarkerName{"aruco_4x4_50", "9"};
  switch (id) {
    case ActionId::next_variant:
      return Case{
          usual, "", {"slots[0].variant"}, [](const ShowState& s) { return s.slots[0].variant == "c"; }};
    case ActionId::previous_variant:
      return Case{
          usual, "", {"slots[0].variant"}, [](const ShowState& s) { return s.slots[0].variant == "a"; }};
    case ActionId::choose_variant:
      return Case{usual, "new one", {"slots[0].variant"}, [](const ShowState& s) {
                    return s.slots[0].variant == "new one";
                  }};
    case ActionId::nudge:
      return Case{held, "1 -2 0.5", {"slots[0].nudge", "slots[0].pin"}, [](const ShowState& s) {
                    return s.slots[0].nudge.isApprox(Eigen::Vector3d(0.101, 0.198, 0.3005), k_exact) &&
                           s.slots[0].pin->prototype_from_part.translation.isApprox(
                               Eigen::Vector3d(0.001, -0.002, 0.0005), k_exact);
                  }};
    case ActionId::place:
      return Case{held, "120 0 -35.5 1 0 0 0", {"slots[0].nudge", "slots[0].pin"}, [](const ShowState& s) {
                    return s.slots[0].nudge.isZero() &&
                           s.slots[0].pin->prototype_from_part.translation.isApprox(
                               Eigen::Vector3d(0.12, 0, -0.0355), k_exact);
                  }};
    case ActionId::release:
      return Case{held, "", {"slots[0].nudge", "slots[0].pin"}, [](const ShowState& s) {
                    return s.slots[0].nudge.isZero() && !s.slots[0].pin;
                  }};
    case ActionId::pair:
      return Case{held, "aruco_4x4_50:7", {"slots[0].marker", "slots[0].pin"}, [](const ShowState& s) {
                    return s.slots[0].marker == MarkerName{"aruco_4x4_50", "7"} && !s.slots[0].pin;
                  }};
    case ActionId::unpair:
      return Case{held, "", {"slots[0].marker", "slots[0].pin"}, [](const ShowState& s) {
                    return !s.slots[0].marker && !s.slots[0].pin;
                  }};
    case ActionId::units:  // done by the session, which stores the unit beside the part's file (pairing_test)
      return Case{usual, "new one mm", {}, [](const ShowState&) { return true; }};
    case ActionId::material:
      return Case{usual, "#ffffff 0 0.4", {"slots[0].material"}, [](const ShowState& s) {
                    return s.slots[0].material == MaterialOverride{Eigen::Vector3d(1, 1, 1), 0, 0.4};
                  }};
    case ActionId::window:
      return Case{usual, "400 40", {"slots[0].window"}, [](const ShowState& s) {
                    return s.slots[0].window == GreyWindow{40, 400};
                  }};
    case ActionId::finish:
      return Case{usual, "sand", {"finish"}, [](const ShowState& s) { return s.finish == "sand"; }};
    case ActionId::section:
      return Case{usual, "hold", {"section"}, [](const ShowState& s) {
                    return s.section.is_on && s.section.is_held;
                  }};
    case ActionId::line:
      return Case{usual, "on", {"lines"}, [](const ShowState& s) { return s.lines.size() == 1; }, "every 50"};
    case ActionId::draw_line:
      return Case{usual,
                  "points 0 0 0 10 0 0",
                  {"lines", "drawn"},
                  [](const ShowState& s) { return s.drawn.size() == 2 && s.drawn[1].name == "edge"; },
                  "edge"};
    case ActionId::erase_line:
      return Case{usual, "", {"drawn"}, [](const ShowState& s) { return s.drawn.empty(); }, ""};
    case ActionId::smooth_line:
      return Case{usual,
                  "",
                  {"drawn"},
                  [](const ShowState& s) {
                    const auto& points = s.drawn[0].curve.points;
                    return points.front().p.norm() < 1e-6 &&
                           (points.back().p - Eigen::Vector3d(0.1, 0, 0)).norm() < 1e-6;
                  },
                  "stroke"};
    case ActionId::move_line:
      return Case{usual,
                  "points 0 0 0 0 10 0",
                  {"drawn"},
                  [](const ShowState& s) { return s.drawn[0].curve.points.front().p.y() > 0.009; },
                  "stroke"};
    case ActionId::rename_line:
      return Case{
          usual, "edge", {"drawn"}, [](const ShowState& s) { return s.drawn[0].name == "edge"; }, "stroke"};
    case ActionId::save_look:
      return Case{usual, "new", {"looks", "look", "other_look"}, [](const ShowState& s) {
                    return s.looks.size() == 4 && s.looks[3].name == "new" && s.look == "new" &&
                           s.other_look == "B";
                  }};
    case ActionId::restore_look:
      return Case{usual,
                  "C",
                  {"look", "other_look", "slots[0].variant", "slots[0].pin", "light"},
                  [](const ShowState& s) {
                    return s.look == "C" && s.other_look == "B" && s.slots[0].variant == "c" && s.light;
                  }};
    case ActionId::next_look:
      return Case{usual,
                  "",
                  {"look", "other_look", "slots[0].variant", "slots[0].pin", "light"},
                  [](const ShowState& s) { return s.look == "C" && s.slots[0].variant == "c"; }};
    case ActionId::previous_look:
      return Case{usual,
                  "",
                  {"look", "other_look", "slots[0].variant", "slots[0].pin", "light"},
                  [](const ShowState& s) { return s.look == "A" && s.slots[0].variant == "a"; }};
    case ActionId::flip:
      return Case{usual,
                  "",
                  {"look", "other_look", "slots[0].variant", "slots[0].pin", "light"},
                  [](const ShowState& s) { return s.look == "A" && s.other_look == "B"; }};
    case ActionId::split:
      return Case{usual, "on", {"split"}, [](const ShowState& s) { return s.split; }};
    case ActionId::split_at:
      return Case{usual, "-12.5", {"split_mm"}, [](const ShowState& s) { return s.split_mm == -12.5; }};
    case ActionId::delete_look:
      return Case{usual, "A", {"looks", "deleted_look", "other_look"}, [](const ShowState& s) {
                    return s.looks.size() == 2 && s.deleted_look->name == "A" && s.other_look.empty();
                  }};
    case ActionId::undelete_look:
      return Case{usual, "", {"looks", "deleted_look"}, [](const ShowState& s) {
                    return s.looks.size() == 4 && s.looks[3].name == "gone" && !s.deleted_look;
                  }};
    case ActionId::repair:  // done by the session's devices (live_test, live_devices_test)
      return Case{usual, "", {}, [](const ShowState&) { return true; }};
    case ActionId::deviation:  // scanned and compared by the session (deviation_test)
      return Case{usual, "tolerance 0.3", {"deviation"}, [](const ShowState& s) {
                    return s.deviation.tolerance_m == 0.3e-3;
                  }};
    case ActionId::light:
      return Case{usual, "30 45 0.6 0.3 0.1", {"light"}, [](const ShowState& s) {
                    return s.light->above_rgb == Eigen::Vector3d::Constant(0.3);
                  }};
    case ActionId::blackout:
      return Case{usual, "on", {"blackout"}, [](const ShowState& s) { return s.blackout; }};
    case ActionId::freeze:
      return Case{usual, "on", {"frozen"}, [](const ShowState& s) { return s.frozen; }};
    case ActionId::grid:
      return Case{usual, "on", {"grid"}, [](const ShowState& s) { return s.grid; }};
    case ActionId::marker_states:
      return Case{usual, "on", {"marker_states"}, [](const ShowState& s) { return s.marker_states; }};
    case ActionId::screen:
      return Case{usual,
                  "stereo",
                  {"screens"},
                  [](const ShowState& s) {
                    return s.screens[1].shows == Screen::stereo && s.screens[0].shows == Screen::rest;
                  },
                  "desk"};
    case ActionId::viewer:
      return Case{usual, "Ann", {"viewer"}, [](const ShowState& s) { return s.viewer == "Ann"; }};
    case ActionId::count:
      return std::nullopt;
  }
  return std::nullopt;
}

TEST(Actions, EachChangesWhatItIsToChangeAndNothingElse) {
  const Scene scene = a_scene();
  for (const Action& action : actions()) {
    const auto wanted = case_of(action.id, scene);
    ASSERT_TRUE(wanted) << action.name << ": expected a case in this test, found none.";
    const auto after =
        apply_edit(scene, wanted->before, {}, make_edit(action.id, wanted->slot, wanted->value));
    ASSERT_TRUE(after) << action.name << ": " << after.message();
    EXPECT_EQ(changed(wanted->before, *after), wanted->members) << action.name;
    EXPECT_TRUE(wanted->is_done(*after)) << action.name;
    if (action.argument_kind != ArgumentKind::on_off) continue;
    // A switch can be set to off again and toggled.
    const auto value = [&](const std::string& word) {
      return changed(wanted->before,
                     *apply_edit(scene, *after, {}, make_edit(action.id, wanted->slot, word)));
    };
    EXPECT_EQ(value("off"), Members()) << action.name;
    EXPECT_EQ(value("toggle"), Members()) << action.name;
    EXPECT_EQ(value(""), Members()) << action.name;
    EXPECT_EQ(value("on"), wanted->members) << action.name;
  }
}

TEST(Actions, WhatTheSessionDoesIsReadAndRefusedInTime) {
  const Scene scene = a_scene();
  const auto unit = command_of(scene, make_edit(ActionId::units, "mirror", "new one mm"));
  ASSERT_TRUE(unit) << unit.message();
  EXPECT_EQ(std::get<PartUnit>(unit->value).part, "new one");
  EXPECT_EQ(std::get<PartUnit>(unit->value).unit, LengthUnit::millimetre);
  ShowState dark = a_staging(scene);
  dark.blackout = true;
  EXPECT_FALSE(apply_edit(scene, dark, {}, make_edit(ActionId::repair)));
}

TEST(Actions, ADeviationNeedsACadLightAndAResult) {
  Scene scene = a_scene();
  ShowState show_state = a_staging(scene);
  const auto apply = [&](const std::string& value) {
    auto after = apply_edit(scene, show_state, {}, make_edit(ActionId::deviation, "", value));
    if (after) show_state = *after;
    return after ? std::string() : after.message();
  };
  EXPECT_EQ(apply(""), "");
  EXPECT_EQ(apply("toggle"), "") << "it scans";
  EXPECT_FALSE(show_state.deviation.is_shown);
  for (const char* needs : {"on", "hold on", "report"})
    EXPECT_NE(apply(needs).find("expected a result, found none"), std::string::npos) << needs;
  for (const char* bad : {"maybe", "hold", "fit", "fit 1 2 3", "fit 0 0 0 0 1 1", "fit 0 0 0 1e9 1 1",
                          "tolerance", "tolerance 0", "tolerance 1 2", "tolerance nan", "on off"})
    EXPECT_NE(apply(bad).find("deviation"), std::string::npos) << bad;
  DeviationLayer layer;
  layer.number = 1;
  show_state.deviation.layer = std::make_shared<const DeviationLayer>(layer);
  EXPECT_EQ(apply("toggle"), "");
  EXPECT_TRUE(show_state.deviation.is_shown);
  EXPECT_EQ(compose_scene(scene, show_state, {}).deviation, (PaintedDeviation{1, 0.5e-3}));
  EXPECT_EQ(apply("hold on"), "");
  EXPECT_TRUE(show_state.deviation.is_held);
  EXPECT_EQ(apply("fit 10,20,30,-10,0,0"), "");
  ASSERT_TRUE(show_state.deviation.fit_box);
  EXPECT_TRUE(show_state.deviation.fit_box->min().isApprox(Eigen::Vector3d(-0.01, 0, 0), k_exact));
  EXPECT_EQ(apply("fit off"), "");
  EXPECT_FALSE(show_state.deviation.fit_box);
  EXPECT_EQ(apply("off"), "");
  EXPECT_EQ(compose_scene(scene, show_state, {}).deviation, PaintedDeviation());
  show_state.blackout = true;
  EXPECT_NE(apply("scan").find("blackout"), std::string::npos);
  scene.prototype->mesh.triangles.clear();
  EXPECT_NE(apply("off").find("expected a prototype with a CAD mesh"), std::string::npos);
  scene.prototype.reset();
  EXPECT_NE(apply("scan").find("expected a prototype with a CAD mesh"), std::string::npos);
}

TEST(Actions, AreFoundByTheirNames) {
  std::set<std::string_view> names;
  for (const Action& action : actions()) {
    EXPECT_TRUE(names.insert(action.name).second) << action.name << " is in the table twice";
    EXPECT_EQ(find_action(action.name), &action);
    EXPECT_EQ(&action_of(action.id), &action);
    EXPECT_EQ(make_edit(action.id, "mirror", "x").action, action.name);
    EXPECT_FALSE(action.what.empty()) << action.name;
    EXPECT_EQ(action.value.empty(), action.argument_kind == ArgumentKind::nothing) << action.name;
  }
  for (const char* unknown : {"", "dance", "next_variant ", "NEXT_VARIANT", "count"})
    EXPECT_EQ(find_action(unknown), nullptr) << unknown;
}

TEST(Actions, WhatIsOppositeGoesThereAndBack) {
  const Scene scene = a_scene();
  int pairs = 0;
  for (const Action& action : actions()) {
    if (!action.opposite) continue;
    EXPECT_EQ(action_of(*action.opposite).opposite, action.id) << action.name;
    EXPECT_EQ(action.argument_kind, ArgumentKind::nothing) << action.name;
    const auto start = apply_edit(scene, a_staging(scene), {}, make_edit(action.id, "mirror"));
    ASSERT_TRUE(start) << start.message();
    const auto there = apply_edit(scene, *start, {}, make_edit(*action.opposite, "mirror"));
    const auto back = apply_edit(scene, *there, {}, make_edit(action.id, "mirror"));
    EXPECT_FALSE(changed(*start, *there).empty()) << action.name;
    EXPECT_EQ(changed(*start, *back), Members()) << action.name;
    ++pairs;
  }
  EXPECT_EQ(pairs, 4);
}

TEST(Actions, NoKeyDoesTwo) {
  std::set<Key> keys = {Key::tab};  // Tab selects a slot
  for (const Action& action : actions()) {
    for (const Key key : action.keys) {
      if (key == Key::none) continue;
      EXPECT_TRUE(keys.insert(key).second) << action.name << " has a key of another action";
    }
    EXPECT_TRUE(action.value_of_keys.empty() || action.keys[0] != Key::none) << action.name;
  }
  EXPECT_GT(keys.size(), 10u);
}

}  // namespace
}  // namespace limn::scene
