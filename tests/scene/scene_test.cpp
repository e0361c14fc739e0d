#include "scene/scene.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "scene/part_units.h"
#include "scene/posed_scene.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

const json k_pose = {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0.1, 0.2, 0.3}}};

json whole_scene() {
  return {
      {"schema", "limn.scene/1"},
      {"prototype",
       {{"mesh", "quad.obj"},
        {"units", "mm"},
        {"albedo", 0.6},
        {"markers", {{{"name", "apriltag_36h11:4"}, {"size_mm", 40}, {"prototype_from_marker", k_pose}}}}}},
      {"slots",
       {{{"name", "mirror"},
         {"marker", "aruco_4x4_50:3"},
         {"size_mm", 30},
         {"marker_from_part", k_pose},
         {"mode", "view"},
         {"stick_to_surface", true},
         {"variants",
          {{{"name", "a"}, {"mesh", "quad.obj"}, {"units", "m"}},
           {{"name", "b"}, {"mesh", "quad.obj"}, {"units", "cm"}}}}},
        {{"name", "trim"},
         {"marker", "aruco_4x4_50:5"},
         {"size_mm", 30},
         {"marker_from_part", k_pose},
         {"mode", "surface"},
         {"variants", {{{"name", "line"}, {"mesh", "quad.obj"}, {"units", "m"}}}}}}},
      {"controls",
       {{{"marker", "aruco_4x4_50:9"},
         {"action", "next_variant"},
         {"slot", "mirror"},
         {"gesture", "cover"}}}},
      {"viewer", {{"fixed", {{"world_from_viewer", k_pose}, {"size", {640, 480}}, {"fov_deg", 40}}}}}};
}

fs::path folder_with(const json& scene) {
  const fs::path folder = test::test_folder();
  EXPECT_TRUE(write_file(folder / "quad.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\n"));
  EXPECT_TRUE(write_file(folder / "scene.json", scene.dump(2)));
  return folder;
}

TEST(Scene, EveryKeyIsRead) {
  const auto scene = load_scene(folder_with(whole_scene()));
  ASSERT_TRUE(scene) << scene.message();
  EXPECT_NEAR(scene->prototype->mesh.positions[2].x(), 0.002, 1e-9);
  EXPECT_EQ(scene->prototype->albedo, 0.6);
  ASSERT_EQ(scene->prototype->markers.size(), 1u);
  EXPECT_EQ(scene->prototype->markers[0].marker.text(), "apriltag_36h11:4");
  EXPECT_NEAR(scene->prototype->markers[0].size_m, 0.04, 1e-12);
  const Slot* mirror = scene->find_slot("mirror");
  ASSERT_TRUE(mirror);
  EXPECT_EQ(mirror->mode, Mode::view);
  EXPECT_TRUE(mirror->stick_to_surface);
  EXPECT_NEAR(mirror->size_m, 0.03, 1e-12);
  EXPECT_NEAR(mirror->marker_from_part.translation.z(), 0.3, 1e-12);
  ASSERT_EQ(mirror->variants.size(), 2u);
  EXPECT_NEAR(mirror->variants[1].mesh.positions[2].x(), 0.02, 1e-8);
  EXPECT_EQ(scene->find_slot("trim")->mode, Mode::surface);
  EXPECT_FALSE(scene->find_slot("grille"));
  EXPECT_EQ(scene->controls[0].action, ActionId::next_variant);
  EXPECT_EQ(scene->controls[0].gesture, Gesture::cover);
  ASSERT_TRUE(scene->viewers.size() == 1 && scene->viewers[0].fixed);
  EXPECT_EQ(scene->viewers[0].fixed->width, 640);
  const auto found = bodies(*scene);
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found[0].name, "prototype");
  EXPECT_EQ(found[2].name, "trim");
  EXPECT_EQ(found[2].markers[0].marker.id, "5");
}

TEST(Scene, PrototypeIsOptionalAndAlbedoMayBeAnImage) {
  json without = whole_scene();
  without.erase("prototype");
  const auto scene = load_scene(folder_with(without) / "scene.json");
  ASSERT_TRUE(scene) << scene.message();
  EXPECT_FALSE(scene->prototype);
  EXPECT_EQ(bodies(*scene).size(), 2u);

  json painted = whole_scene();
  painted["prototype"]["mesh"] = "uv.obj";
  painted["prototype"]["albedo"] = "paint.png";
  const fs::path folder = folder_with(painted);
  ASSERT_TRUE(
      write_file(folder / "uv.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"));
  ASSERT_TRUE(write_png(folder / "paint.png", cv::Mat(4, 4, CV_8UC3, cv::Scalar(1, 2, 3))));
  const auto with_image = load_scene(folder);
  ASSERT_TRUE(with_image) << with_image.message();
  EXPECT_EQ(with_image->prototype->albedo_image.at<cv::Vec3b>(3, 3), cv::Vec3b(1, 2, 3));
}

TEST(Scene, AMarkerMayCarryTheViewersEye) {
  json worn = whole_scene();
  worn["viewer"] = {{"marker", "apriltag_36h11:30"}, {"size_mm", 25}, {"eye_mm", {0, 60, 10}}};
  const auto scene = load_scene(folder_with(worn));
  ASSERT_TRUE(scene) << scene.message();
  const auto found = bodies(*scene);
  ASSERT_EQ(found.size(), 4u);
  EXPECT_EQ(found[3].name, viewer_body(0));
  EXPECT_NEAR(found[3].markers[0].size_m, 0.025, 1e-12);
  Track prototype, cap;
  prototype.body = "prototype";
  prototype.world_from_body = Pose(Eigen::Quaterniond::Identity(), {0, 0, 1.5});
  cap.body = viewer_body(0);
  cap.world_from_body =
      Pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY())), {0.3, -0.2, 0.1});
  const std::vector<Track> tracks = {prototype, cap};
  const PosedScene there = posed(*scene, tracks);
  ASSERT_EQ(there.viewpoints.size(), 1u);
  const auto viewer = viewer_of(*scene, there, -Eigen::Vector3d::UnitY());
  ASSERT_TRUE(viewer);
  EXPECT_TRUE(test::near(viewer->imager_from_world.inverse().translation,
                         Eigen::Vector3d(cap.world_from_body * Eigen::Vector3d(0, 0.06, 0.01)), 1e-9));
  const auto middle = viewer->project(prototype.world_from_body * Eigen::Vector3d(0.001, 0.001, 0));
  ASSERT_TRUE(middle);
  EXPECT_TRUE(test::near(*middle, Eigen::Vector2d(639.5, 399.5), 0.1));
  EXPECT_FALSE(viewer_of(*scene, posed(*scene, std::span(tracks).first(1)), -Eigen::Vector3d::UnitY()));
}

TEST(Scene, SeveralViewersShareOneEye) {
  json watched = whole_scene();
  const json fixed = watched["viewer"]["fixed"];
  watched["viewer"] = {{{"fixed", fixed}}, {{"marker", "apriltag_36h11:30"}, {"weight", 2}}};
  const auto scene = load_scene(folder_with(watched));
  ASSERT_TRUE(scene) << scene.message();
  ASSERT_EQ(scene->viewers.size(), 2u);
  Track prototype, cap;
  prototype.body = "prototype";
  cap.body = viewer_body(1);
  const Eigen::Vector3d p_fixed = scene->viewers[0].fixed->imager_from_world.inverse().translation;
  cap.world_from_body.translation = p_fixed + Eigen::Vector3d(0.05, 0, 0);
  const std::vector<Track> tracks = {prototype, cap};
  const Eigen::Vector3d up = -Eigen::Vector3d::UnitY();
  const auto both = viewer_of(*scene, posed(*scene, tracks), up);
  ASSERT_TRUE(both);
  const Eigen::Vector3d p_both = both->imager_from_world.inverse().translation;
  EXPECT_GT((p_both - p_fixed).norm(), 0.028);  // nearer to the viewer of weight 2
  EXPECT_LT((p_both - cap.world_from_body.translation).norm(), 0.022);
  const auto alone = viewer_of(*scene, posed(*scene, std::span(tracks).first(1)), up);
  ASSERT_TRUE(alone);
  EXPECT_TRUE(test::near(alone->imager_from_world.inverse().translation, p_fixed, 1e-9));
  watched["viewer"][0] = watched["viewer"][1];
  EXPECT_NE(load_scene(folder_with(watched)).message().find("viewer[1].marker"), std::string::npos);
}

TEST(Scene, GuestsTabletsMayBeViewers) {
  json watched = whole_scene();
  const json fixed = watched["viewer"]["fixed"];
  watched["viewer"] = {{{"fixed", fixed}}, {{"tablet", "Ann"}, {"weight", 3}}};
  const auto named = load_scene(folder_with(watched));
  ASSERT_TRUE(named) << named.message();
  EXPECT_EQ(bodies(*named).size(), 3u);  // tablets have no marker
  ASSERT_TRUE(named->find_tablet("Ann"));
  EXPECT_EQ(named->find_tablet("Ann")->weight, 3);
  EXPECT_FALSE(named->find_tablet("Ben"));
  watched["viewer"].push_back({{"tablet", true}});
  const auto all = load_scene(folder_with(watched));
  ASSERT_TRUE(all) << all.message();
  ASSERT_TRUE(all->find_tablet("Ann") && all->find_tablet("Ben"));
  EXPECT_EQ(all->find_tablet("Ann")->weight, 3);
  EXPECT_EQ(all->find_tablet("Ben")->weight, 1);
  watched["viewer"].push_back({{"tablet", true}});
  EXPECT_NE(load_scene(folder_with(watched)).message().find("viewer[3].tablet"), std::string::npos);
}

TEST(Scene, ThingsOfAnAbsurdSizeAreAskedAbout) {
  const auto loaded = [](const char* units, const char* mesh) {
    json scene = whole_scene();
    scene["slots"][0]["variants"][0] = {{"name", "a"}, {"mesh", "mirror.obj"}, {"units", units}};
    const fs::path folder = folder_with(scene);
    EXPECT_TRUE(write_file(folder / "mirror.obj", mesh));
    return load_scene(folder);
  };
  const auto large = loaded("m", "v 0 0 0\nv 200 0 0\nv 0 100 0\nf 1 2 3\n");
  ASSERT_FALSE(large);
  EXPECT_NE(large.message().find("224 m across"), std::string::npos) << large.message();
  EXPECT_NE(large.message().find("slots[0].variants[0]"), std::string::npos) << large.message();
  EXPECT_NE(large.message().find("mm (0.224 m)"), std::string::npos) << large.message();
  EXPECT_TRUE(loaded("mm", "v 0 0 0\nv 200 0 0\nv 0 100 0\nf 1 2 3\n"));
  const auto small = loaded("mm", "v 0 0 0\nv 0.2 0 0\nv 0 0.1 0\nf 1 2 3\n");
  ASSERT_FALSE(small);
  EXPECT_NE(small.message().find(" m (0.224 m)"), std::string::npos) << small.message();
}

TEST(Scene, MistakesAreErrorsWithTheirPath) {
  struct Mistake {
    const char* patch;  // a JSON patch
    const char* says;
  };
  const Mistake mistakes[] = {
      {R"([{"op":"add","path":"/colour","value":1}])", "colour"},
      {R"([{"op":"add","path":"/slots/0/stick","value":true}])", "slots[0]"},
      {R"([{"op":"remove","path":"/prototype/units"}])", "prototype.units"},
      {R"([{"op":"remove","path":"/slots/1/variants/0/units"}])", "slots[1].variants[0].units"},
      {R"([{"op":"replace","path":"/slots/0/variants/0/units","value":"yard"}])", "yard"},
      {R"([{"op":"replace","path":"/slots/1/name","value":"mirror"}])", "slots[1].name"},
      {R"([{"op":"replace","path":"/slots/1/name","value":"prototype"}])", "prototype"},
      {R"([{"op":"replace","path":"/slots/1/name","value":"../trim"}])", "slots[1].name"},
      {R"([{"op":"replace","path":"/slots/0/variants/1/name","value":"a"}])", "slots[0].variants[1].name"},
      {R"([{"op":"replace","path":"/slots/0/variants","value":[]}])", "slots[0].variants"},
      {R"([{"op":"replace","path":"/slots/1/marker","value":"aruco_4x4_50:3"}])", "slots[1].marker"},
      {R"([{"op":"replace","path":"/slots/1/marker","value":"five"}])", "slots[1].marker"},
      {R"([{"op":"replace","path":"/slots/1/size_mm","value":-3}])", "slots[1].size_mm"},
      {R"([{"op":"replace","path":"/slots/1/mode","value":"hologram"}])", "slots[1].mode"},
      {R"([{"op":"replace","path":"/slots/1/variants/0/mesh","value":"nowhere.glb"}])", "nowhere.glb"},
      {R"([{"op":"replace","path":"/prototype/mesh","value":"/etc/door.obj"}])", "prototype.mesh"},
      {R"([{"op":"replace","path":"/prototype/mesh","value":"../quad.obj"}])", "prototype.mesh"},
      {R"([{"op":"replace","path":"/prototype/albedo","value":1.5}])", "prototype.albedo"},
      {R"([{"op":"replace","path":"/prototype/albedo","value":"nowhere.png"}])", "nowhere.png"},
      {R"([{"op":"replace","path":"/slots/0/marker_from_part/rotation_wxyz","value":[2,0,0,0]}])",
       "marker_from_part"},
      {R"([{"op":"replace","path":"/controls/0/slot","value":"grille"}])", "controls[0].slot"},
      {R"([{"op":"replace","path":"/controls/0/action","value":"dance"}])", "controls[0].action"},
      {R"([{"op":"replace","path":"/controls/0/gesture","value":"wave"}])", "controls[0].gesture"},
      {R"([{"op":"add","path":"/viewer/marker","value":"aruco_4x4_50:8"}])", "viewer"},
      {R"([{"op":"add","path":"/viewer/tablet","value":true}])", "viewer"},
      {R"([{"op":"replace","path":"/viewer","value":{"tablet":false}}])", "viewer.tablet"},
      {R"([{"op":"replace","path":"/viewer","value":{"tablet":""}}])", "viewer.tablet"},
      {R"([{"op":"replace","path":"/viewer","value":{"weight":2}}])", "viewer"},
      {R"([{"op":"replace","path":"/viewer/fixed/fov_deg","value":200}])", "viewer.fixed.fov_deg"},
      {R"([{"op":"add","path":"/light","value":{"up_world":[0,0,0],"soft_below":[0,0,0],"soft_above":[1,1,1]}}])",
       "light.up_world"},
      {R"([{"op":"add","path":"/light","value":{"up_world":[0,0,1],"soft_below":[0,-1,0],"soft_above":[1,1,1]}}])",
       "light.soft_below"},
      {R"([{"op":"add","path":"/light","value":{"up_world":[0,0,1],"soft_below":[0,0,0],"soft_above":[1,1,1],"lamps":[{"towards_world":[0,0,1],"strength":1}]}}])",
       "light.lamps[0].strength"},
      {R"([{"op":"replace","path":"/viewer/fixed/size","value":[640.5,480]}])", "viewer.fixed.size"},
      {R"([{"op":"replace","path":"/slots","value":"none"}])", "slots"},
      {R"([{"op":"replace","path":"/schema","value":"limn.rig/1"}])", "schema"},
  };
  for (const Mistake& mistake : mistakes) {
    const auto scene = load_scene(folder_with(whole_scene().patch(json::parse(mistake.patch))));
    ASSERT_FALSE(scene) << mistake.patch;
    EXPECT_NE(scene.message().find(mistake.says), std::string::npos) << mistake.patch << "\n"
                                                                     << scene.message();
    EXPECT_NE(scene.message().find("scene.json"), std::string::npos) << scene.message();
  }
}

TEST(Scene, MissingAndTruncatedFilesAreErrors) {
  EXPECT_FALSE(load_scene(test::test_folder()));
  const fs::path folder = folder_with(whole_scene());
  const std::string text = whole_scene().dump();
  ASSERT_TRUE(write_file(folder / "scene.json", text.substr(0, text.size() / 2)));
  EXPECT_FALSE(load_scene(folder));
}

// A session starts with the parts that can be loaded.
TEST(Scene, PartsThatCannotBeLoadedAreLeftOutWhenThatIsAskedFor) {
  const fs::path door = fs::path(LIMN_SOURCE_DIR) / "config/scenes/door",
                 folder = test::test_folder() / "door";
  fs::copy(door, folder);
  fs::create_directories(folder / "slots/mirror");
  ASSERT_TRUE(write_file(folder / "slots/mirror/half.glb", "glTF"));
  fs::remove(folder / "mirror-sport.glb");
  EXPECT_FALSE(load_scene(folder));
  testing::internal::CaptureStderr();
  const auto warned = load_usable_scene(folder);
  const std::string messages = testing::internal::GetCapturedStderr();
  ASSERT_TRUE(warned) << warned.message();
  for (const char* word : {"of slot mirror is left out", "mirror-sport.glb", "half.glb"})
    EXPECT_NE(messages.find(word), std::string::npos) << word << " in: " << messages;
  std::vector<SkippedVariant> skipped_variants;
  const auto scene = load_scene(folder, &skipped_variants);
  ASSERT_TRUE(scene) << scene.message();
  EXPECT_EQ(scene->find_slot("mirror")->variants.size(), 2u);
  ASSERT_EQ(skipped_variants.size(), 2u);
  EXPECT_EQ(skipped_variants[0].slot, "mirror");
  EXPECT_NE(skipped_variants[0].why.find("mirror-sport.glb"), std::string::npos) << skipped_variants[0].why;
  EXPECT_EQ(skipped_variants[1].variant, "half");

  fs::remove(folder / "trim-line.glb");
  skipped_variants.clear();
  const auto without_trim = load_scene(folder, &skipped_variants);
  ASSERT_TRUE(without_trim) << without_trim.message();
  EXPECT_EQ(without_trim->find_slot("trim"), nullptr);
  EXPECT_EQ(skipped_variants.size(), 3u);
}

TEST(Scene, PartsWhoseFileNamesAreNotUtf8AreLeftOut) {
  const fs::path door = fs::path(LIMN_SOURCE_DIR) / "config/scenes/door",
                 folder = test::test_folder() / "door";
  fs::copy(door, folder);
  fs::create_directories(folder / "slots/mirror");
  fs::copy(door / "mirror-city.glb", folder / "slots/mirror/gr\xfcn.glb");
  std::vector<SkippedVariant> skipped_variants;
  const auto scene = load_scene(folder, &skipped_variants);
  ASSERT_TRUE(scene) << scene.message();
  ASSERT_EQ(skipped_variants.size(), 1u);
  EXPECT_EQ(skipped_variants[0].variant, "gr\xef\xbf\xbdn");
  EXPECT_NE(skipped_variants[0].why.find("expected a file name in UTF-8"), std::string::npos)
      << skipped_variants[0].why;
}

// What people leave in a slot's folder besides meshes is listed with the reason; what belongs to meshes is
// not.
TEST(Scene, WhatIsNoMeshInASlotsFolderIsListedWithTheReason) {
  const fs::path folder = folder_with(whole_scene()), slots = folder / "slots";
  const std::string mesh = "v 0 0 0\nv 200 0 0\nv 0 100 0\nf 1 2 3\n";
  for (const char* taken :
       {"mirror/Chrome.OBJ", "mirror/unzipped/part.obj", "mirorr/part.obj", "stray.obj"}) {
    fs::create_directories((slots / taken).parent_path());
    ASSERT_TRUE(write_file(slots / taken, mesh));
  }
  for (const char* name : {"housing.sldprt", "project.blend", "all.zip", "notes.txt", "wood.png", "part.mtl",
                           "part.bin", ".hidden", "~lock"})
    ASSERT_TRUE(write_file(slots / "mirror" / name, "x"));
  std::vector<SkippedVariant> skipped;
  const auto scene = load_scene(folder, &skipped);
  ASSERT_TRUE(scene) << scene.message();
  EXPECT_EQ(scene->find_slot("mirror")->variants.back().name, "Chrome");
  std::map<std::string, std::string> reasons;
  for (const SkippedVariant& item : skipped) reasons[item.slot + "/" + item.variant] = item.why;
  const std::map<std::string, std::string> expected = {
      {"mirror/housing.sldprt", "Export it as STEP"},
      {"mirror/project.blend", "a project of a modelling program"},
      {"mirror/all.zip", "Unpack it"},
      {"mirror/notes.txt", "it is no mesh that Limn reads"},
      {"mirror/unzipped", "it is a folder"},
      {"(none)/mirorr", "named after a slot (mirror, trim)"},
      {"(none)/stray.obj", "in a slot's folder (mirror, trim)"}};
  EXPECT_EQ(reasons.size(), expected.size());
  for (const auto& [name, why] : expected)
    EXPECT_NE(reasons[name].find(why), std::string::npos) << name << ": " << reasons[name];
}

TEST(Scene, FilesThatStateTheirUnitNeedNoneAndAreNotAskedAbout) {
  const fs::path door = fs::path(LIMN_SOURCE_DIR) / "config/scenes/door";
  json scene = whole_scene();
  scene["slots"][0]["variants"][0] = {{"name", "a"}, {"mesh", "city.glb"}};
  const fs::path folder = folder_with(scene), mirror = folder / "slots/mirror";
  fs::create_directories(mirror);
  fs::copy_file(door / "mirror-city.glb", folder / "city.glb");
  fs::copy_file(door / "mirror-city.glb", mirror / "dropped.glb");
  ASSERT_TRUE(write_file(mirror / "unknown.obj", "v 0 0 0\nv 149 0 0\nv 0 60 0\nf 1 2 3\n"));
  const auto loaded = load_scene(folder);
  ASSERT_TRUE(loaded) << loaded.message();
  const std::vector<Variant>& variants = loaded->find_slot("mirror")->variants;
  ASSERT_EQ(variants.size(), 4U);
  EXPECT_EQ(variants[2].name, "dropped");
  EXPECT_EQ(variants[2].mesh.positions, variants[0].mesh.positions);
  EXPECT_EQ(units_question(*loaded->find_slot("mirror"), variants[2]), "");
  EXPECT_NE(
      units_question(*loaded->find_slot("mirror"), variants[3]).find("assumed to be in mm, 149 mm long"),
      std::string::npos);
  // Only answers of people are written, not what files state.
  const std::string units = units_json(*loaded->find_slot("mirror"), "unknown", LengthUnit::inch);
  EXPECT_EQ(units.find("dropped"), std::string::npos) << units;
}

TEST(Scene, TheDoorOfTheConfigFolderLoads) {
  const auto scene = load_scene(fs::path(LIMN_SOURCE_DIR) / "config/scenes/door");
  ASSERT_TRUE(scene) << scene.message();
  EXPECT_TRUE(scene->prototype);
  EXPECT_EQ(scene->find_slot("mirror")->variants.size(), 3u);
}

TEST(Viewer, FileIsAnImagerWithoutDistortion) {
  const fs::path file = test::test_folder() / "viewer.json";
  json viewer = {{"world_from_viewer", k_pose}, {"size", {801, 600}}, {"fov_deg", 40}};
  ASSERT_TRUE(write_file(file, viewer.dump()));
  const auto imager = load_viewer(file);
  ASSERT_TRUE(imager) << imager.message();
  EXPECT_NEAR(imager->lens.cx(), 400, 1e-9);
  EXPECT_TRUE(test::near(imager->ray({400, 299.5})->p_origin, Eigen::Vector3d(0.1, 0.2, 0.3), 1e-12));
  viewer.erase("fov_deg");
  ASSERT_TRUE(write_file(file, viewer.dump()));
  const auto missing = load_viewer(file);
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.message().find("fov_deg"), std::string::npos);
}

// A scene whose slot and prototype balls carry.
json scene_with_balls() {
  json scene = whole_scene();
  scene["prototype"]["markers"] = {{{"name", "constellation:frame.json"}, {"prototype_from_marker", k_pose}}};
  scene["slots"][0]["marker"] = "constellation:wand.json";
  scene["slots"][0].erase("size_mm");
  return scene;
}

// The folder of such a scene; wand.json and other.json are alike.
fs::path folder_with_balls(const json& scene) {
  const fs::path folder = folder_with(scene);
  json balls = {{"schema", "limn.constellation/1"}, {"name", "wand"}, {"ball_diameter_mm", 40}};
  balls["balls_mm"] = {{0, 0, 0}, {140, 0, 0}, {60, 80, 20}};
  EXPECT_TRUE(write_file(folder / "wand.json", balls.dump()));
  EXPECT_TRUE(write_file(folder / "other.json", balls.dump()));
  balls["balls_mm"] = {{-205, 135, 20}, {200, 120, 65}, {-215, -30, 75}, {110, -150, 25}, {25, 170, -10}};
  EXPECT_TRUE(write_file(folder / "frame.json", balls.dump()));
  return folder;
}

TEST(Scene, BallsMayCarryThePrototypeAndSlots) {
  const auto scene = load_scene(folder_with_balls(scene_with_balls()));
  ASSERT_TRUE(scene) << scene.message();
  const std::vector<Constellation> balls = constellations(*scene);
  ASSERT_EQ(balls.size(), 2u);
  EXPECT_EQ(balls[0].name, "prototype");
  EXPECT_TRUE(test::near(balls[0].p_balls[0], Eigen::Vector3d(-0.105, 0.335, 0.32), 1e-12));
  EXPECT_EQ(balls[1].name, "mirror");
  EXPECT_EQ(balls[1].radius_m, 0.02);
  EXPECT_TRUE(test::near(balls[1].p_balls[2], Eigen::Vector3d(0.06, 0.08, 0.02), 1e-12));
  const std::vector<Body> square = bodies(*scene);
  ASSERT_EQ(square.size(), 1u);
  EXPECT_EQ(square[0].name, "trim");
  EXPECT_EQ(first_marker_size_m(*scene), 0.03);
}

TEST(Scene, MistakesWithBallsAreErrorsWithTheirPath) {
  const json good = scene_with_balls();
  const auto expect = [&](const char* place, const json& value, std::vector<std::string> parts) {
    json scene = good;
    scene[json::json_pointer(place)] = value;
    const auto loaded = load_scene(folder_with_balls(scene));
    ASSERT_FALSE(loaded) << place;
    for (const std::string& part : parts)
      EXPECT_NE(loaded.message().find(part), std::string::npos) << part << ": " << loaded.message();
  };
  expect("/slots/0/size_mm", 30, {"slots[0].size_mm", "whose file states"});
  expect("/slots/0/marker", "constellation:none.json", {"slots[0].marker", "none.json"});
  expect("/slots/0/marker", "constellation:../wand.json", {"slots[0].marker", "inside the file's folder"});
  expect("/slots/1/marker", "constellation:wand.json", {"slots[1].marker", "slots[0].marker uses"});
  expect("/prototype/markers/1",
         {{"name", "aruco_4x4_50:7"}, {"size_mm", 40}, {"prototype_from_marker", k_pose}},
         {"prototype.markers", "either square markers or one constellation"});
  expect("/controls/0/marker", "constellation:wand.json", {"controls[0].marker", "square marker"});
  expect("/slots/1",
         {{"name", "trim"},
          {"marker", "constellation:other.json"},
          {"marker_from_part", k_pose},
          {"variants", {{{"name", "line"}, {"mesh", "quad.obj"}, {"units", "m"}}}}},
         {"'mirror' and 'trim'", "expected different ones"});
}

}  // namespace
}  // namespace limn::scene
