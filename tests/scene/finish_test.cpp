#include "scene/finish.h"

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "scene/actions.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

json painted_scene() {
  return {{"schema", "limn.scene/1"},
          {"prototype", {{"mesh", "clay.obj"}, {"units", "m"}}},
          {"slots", json::array()},
          {"finishes",
           {{{"name", "lacquer"},
             {"base_colour", {0.5, 0.25, 0}},
             {"metallic", 0.25},
             {"roughness", 0.5},
             {"clearcoat", 1},
             {"clearcoat_roughness", 0.125},
             {"mode", "view"},
             {"image",
              {{"file", "decal.png"},
               {"size_mm", {300, 200}},
               {"repeats", true},
               {"prototype_from_image", {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0.1, 0, 0}}}}}}},
            {{"name", "sand"}, {"base_colour", {0.6, 0.5, 0.4}}}}}};
}

Result<Scene> loaded(const json& scene) {
  const fs::path folder = test::test_folder();
  EXPECT_TRUE(write_file(folder / "scene.json", scene.dump()));
  EXPECT_TRUE(write_file(folder / "clay.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  EXPECT_TRUE(write_png(folder / "decal.png", cv::Mat(4, 4, CV_8UC4, cv::Scalar(1, 2, 3, 128))));
  return load_scene(folder);
}

TEST(Finish, EveryKeyIsRead) {
  const auto scene = loaded(painted_scene());
  ASSERT_TRUE(scene) << scene.message();
  EXPECT_EQ(finish_names(*scene), (std::vector<std::string>{"lacquer", "sand"}));
  const Finish &lacquer = scene->finishes[0], &sand = scene->finishes[1];
  EXPECT_EQ(lacquer.base_colour, Eigen::Vector3d(0.5, 0.25, 0));
  EXPECT_EQ(lacquer.metallic, 0.25);
  EXPECT_EQ(lacquer.roughness, 0.5);
  EXPECT_EQ(lacquer.clearcoat, 1);
  EXPECT_EQ(lacquer.clearcoat_roughness, 0.125);
  EXPECT_TRUE(lacquer.for_viewer && lacquer.image && lacquer.image->repeats && lacquer.image->projection);
  EXPECT_EQ(lacquer.image->texture.image.at<cv::Vec4b>(0, 0), cv::Vec4b(1, 2, 3, 128));
  EXPECT_TRUE(test::near(lacquer.image->projection->size_m, Eigen::Vector2d(0.3, 0.2), 1e-12));
  EXPECT_EQ(lacquer.image->projection->prototype_from_image.translation.x(), 0.1);
  EXPECT_FALSE(sand.for_viewer || sand.image);
  EXPECT_TRUE(sand.metallic == 0 && sand.roughness == 1 && sand.clearcoat == 0);
}

TEST(Finish, WhatIsWrongIsNamed) {
  const auto message = [](const std::function<void(json*)>& change) {
    json scene = painted_scene();
    change(&scene);
    const auto found = loaded(scene);
    return found ? std::string("(no error)") : found.message();
  };
  const auto expect = [](const std::string& found, const char* words) {
    EXPECT_NE(found.find(words), std::string::npos) << words << " in: " << found;
  };
  expect(message([](json* s) { (*s)["finishes"][0]["metallic"] = 2; }),
         "finishes[0].metallic: expected 0 to 1");
  expect(message([](json* s) {
           (*s)["finishes"][0]["base_colour"] = {2, 0, 0};
         }),
         "linear light from 0 to 1");
  expect(message([](json* s) { (*s)["finishes"][1]["name"] = "lacquer"; }), "expected a unique name");
  expect(message([](json* s) { (*s)["finishes"][0]["gloss"] = 1; }), "gloss");
  expect(message([](json* s) { (*s)["finishes"][0]["image"]["file"] = "none.png"; }), "none.png");
  expect(message([](json* s) { (*s)["finishes"][0]["image"]["size_mm"] = {1}; }), "width and height in mm");
  expect(message([](json* s) { (*s)["finishes"][0]["image"].erase("size_mm"); }), "size_mm");
  expect(message([](json* s) { s->erase("prototype"); }), "expected a prototype to paint");
  // Without a projection the image needs the mesh's texture coordinates.
  expect(message([](json* s) {
           (*s)["finishes"][0]["image"] = {{"file", "decal.png"}};
         }),
         "expected a prototype with texture coordinates");
}

TEST(Finish, IsChosenByAnActionAndKeptByLooks) {
  const auto scene = loaded(painted_scene());
  ASSERT_TRUE(scene) << scene.message();
  ShowState state = initial_show_state(*scene);
  EXPECT_EQ(compose_scene(*scene, state, {}).finish, "");
  const auto done = [&](const std::string& action, const std::string& value) {
    const auto after = apply_edit(*scene, state, compose_scene(*scene, state, {}), Edit{action, "", value});
    if (after) state = *after;
    return after ? std::string() : after.message();
  };
  EXPECT_NE(done("finish", "gold").find("expected one of the scene's finishes"), std::string::npos);
  EXPECT_EQ(done("finish", "lacquer"), "");
  EXPECT_EQ(compose_scene(*scene, state, {}).finish, "lacquer");
  EXPECT_EQ(done("save_look", "evening"), "");
  EXPECT_EQ(done("finish", ""), "");
  EXPECT_EQ(compose_scene(*scene, state, {}).finish, "");
  EXPECT_FALSE(is_same(compose_scene(*scene, state, {}),
                       compose_scene(*scene, with_look(*scene, state, state.looks[0]), {})));
  EXPECT_EQ(done("restore_look", "evening"), "");
  EXPECT_EQ(state.finish, "lacquer");
  Scene without = *scene;
  without.finishes.clear();
  EXPECT_EQ(with_look(without, state, state.looks[0]).finish, "");
  const fs::path file = scene->folder / "evening.json";
  ASSERT_TRUE(write_file(file, look_json(state.looks[0])));
  const auto look = load_look(file, *scene);
  ASSERT_TRUE(look) << look.message();
  EXPECT_EQ(look->finish, "lacquer");
  ASSERT_TRUE(write_file(file, R"({"schema": "limn.look/1", "name": "a", "slots": {}, "finish": "gold"})"));
  const auto unknown = load_look(file, *scene);
  EXPECT_NE(unknown.message().find("gold"), std::string::npos);
}

TEST(RoomLight, TheActionLightKeepsThePictureOfTheRoom) {
  Scene scene;
  scene.light = RoomLight{};
  scene.light->image_strength = 0.5;
  ShowState state = initial_show_state(scene);
  const auto after =
      apply_edit(scene, state, compose_scene(scene, state, {}), Edit{"light", "", "30 45 0.6 0.3 0.1"});
  ASSERT_TRUE(after) << after.message();
  EXPECT_EQ(after->light->image_strength, 0.5);
}

}  // namespace
}  // namespace limn::scene
