// Volumes as parts: in scene files and slots' folders, their windows, and in looks.
#include "scene/volume_part.h"

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "scene/actions.h"
#include "scene/meshes/closed_pieces.h"
#include "scene/show_state.h"
#include "tests/support/matchers.h"
#include "tests/support/volume_files.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;

// 4 x 3 x 2 voxels of 10 mm; the first is centred at (100, 0, 0) mm.
std::string nifti() {
  test::NiftiFile file;
  file.dim = {3, 4, 3, 2, 1, 1, 1, 1};
  file.srow = {{{10, 0, 0, 100}, {0, 10, 0, 0}, {0, 0, 10, 0}}};
  for (int i = 0; i < 24; ++i) file.add_value(static_cast<std::int16_t>(i));
  return file.bytes();
}

json scene_with(json variants) {
  return {{"schema", "limn.scene/1"},
          {"slots",
           {{{"name", "head"},
             {"marker", "aruco_4x4_50:3"},
             {"size_mm", 30},
             {"marker_from_part", {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0, 0, 0}}}},
             {"variants", std::move(variants)}}}}};
}

fs::path folder_with(const json& scene) {
  fs::path folder = test::test_folder();
  EXPECT_TRUE(write_file(folder / "head.nii", nifti()));
  EXPECT_TRUE(write_file(folder / "quad.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\n"));
  EXPECT_TRUE(write_file(folder / "scene.json", scene.dump(2)));
  return folder;
}

const json k_head = {{"name", "a"}, {"volume", "head.nii"}};

Eigen::AlignedBox3d box_of(const Mesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p.cast<double>());
  return box;
}

TEST(VolumePart, ASceneNamesAVolumeWithItsWindowAndScale) {
  json windowed = k_head;
  windowed["name"] = "b";
  windowed["scale"] = 0.5;
  windowed["window"] = {{"width", 10}, {"level", 3}};
  const auto scene = load_scene(folder_with(scene_with({k_head, windowed})));
  ASSERT_TRUE(scene) << scene.message();
  const std::vector<Variant>& variants = scene->slots[0].variants;
  ASSERT_EQ(variants.size(), 2U);
  ASSERT_TRUE(variants[0].volume && variants[1].volume);
  const Eigen::AlignedBox3d box = box_of(variants[0].mesh), half = box_of(variants[1].mesh);
  EXPECT_LT((box.min() - Eigen::Vector3d(0.095, -0.005, -0.005)).norm(), 1e-7);
  EXPECT_LT((box.max() - Eigen::Vector3d(0.135, 0.025, 0.015)).norm(), 1e-7);
  EXPECT_LT((half.max() - 0.5 * box.max()).norm(), 1e-7);
  EXPECT_EQ(shown_window(variants[0], {}), variants[0].volume->window);
  EXPECT_EQ(shown_window(variants[1], {}), (GreyWindow{3, 10}));
  EXPECT_EQ(shown_window(variants[1], GreyWindow{1, 2}), (GreyWindow{1, 2}));
}

TEST(VolumePart, ItsBoxIsClosedAndFacesOutwards) {
  for (const double sign : {1.0, -1.0}) {
    Volume volume;
    volume.size = {3, 4, 5};
    volume.part_from_voxel.linear() << 0.01 * sign, 0.002, 0, 0, 0.02, 0, 0.001, 0, 0.03;
    const Mesh box = volume_box(volume);
    ASSERT_EQ(box.triangles.size(), 12U);
    for (const bool is_closed : are_of_closed_pieces(box)) EXPECT_TRUE(is_closed);
    double six_volumes = 0;
    for (const auto& t : box.triangles)
      six_volumes += box.positions[t[0]].cast<double>().dot(
          box.positions[t[1]].cast<double>().cross(box.positions[t[2]].cast<double>()));
    const double expected = 60 * std::abs(volume.part_from_voxel.linear().determinant());
    EXPECT_NEAR(six_volumes / 6, expected, 1e-5 * expected) << sign;
  }
}

TEST(VolumePart, FilesInASlotsFolderBecomeVariants) {
  const fs::path folder = folder_with(scene_with(json::array({k_head}))), slot = folder / "slots" / "head";
  fs::create_directories(slot / "series");
  ASSERT_TRUE(write_file(slot / "dropped.nii", nifti()));
  for (int k = 0; k < 3; ++k) {
    test::DicomFile file;
    file.position = "0\\0\\" + std::to_string(k);
    for (int i = 0; i < 4; ++i) file.add_value(i);
    ASSERT_TRUE(write_file(slot / "series" / std::to_string(k), file.bytes()));
  }
  const auto scene = load_scene(folder);
  ASSERT_TRUE(scene) << scene.message();
  std::vector<std::string> names;
  for (const Variant& variant : scene->slots[0].variants) {
    names.push_back(variant.name);
    EXPECT_TRUE(variant.volume) << variant.name;
  }
  EXPECT_THAT(names, ::testing::ElementsAre("a", "dropped", "series"));
}

TEST(VolumePart, WrongEntriesAreNamed) {
  const auto problem = [](json variant) {
    const auto scene = load_scene(folder_with(scene_with(json::array({std::move(variant)}))));
    return scene ? std::string() : scene.message();
  };
  json variant = k_head;
  variant["mesh"] = "quad.obj";
  EXPECT_THAT(problem(variant), HasSubstr("slots[0].variants[0].volume: expected either"));
  variant = k_head;
  variant["units"] = "mm";
  EXPECT_THAT(problem(variant), HasSubstr("variants[0].units: expected no unit"));
  variant = {{"name", "a"}, {"mesh", "quad.obj"}, {"units", "m"}, {"window", {{"width", 1}, {"level", 0}}}};
  EXPECT_THAT(problem(variant), HasSubstr("variants[0].window: expected it beside"));
  variant = k_head;
  variant["window"] = {{"width", 0}, {"level", 0}};
  EXPECT_THAT(problem(variant), HasSubstr("variants[0].window: expected a width above 0"));
  variant = k_head;
  variant["volume"] = "none.nii";
  EXPECT_THAT(problem(variant), HasSubstr("none.nii"));
  variant = k_head;
  variant["scale"] = 1000;
  EXPECT_THAT(problem(variant), HasSubstr("expected an object of 1 mm to 20 m"));
}

TEST(VolumePart, AWindowIsReadFromText) {
  EXPECT_EQ(parse_grey_window("400 40").value(), (GreyWindow{40, 400}));
  EXPECT_FALSE(parse_grey_window(" ").value());
  for (const char* bad : {"400", "0 40", "-1 40", "400 x", "400 40 1", "nan 1", "1 inf", "1e39 0"})
    EXPECT_FALSE(parse_grey_window(bad)) << bad;
  EXPECT_EQ(parse_grey_window(format_grey_window(GreyWindow{-12.5, 0.25})).value(),
            (GreyWindow{-12.5, 0.25}));
  EXPECT_EQ(format_grey_window({}), "");
}

TEST(VolumePart, ALookKeepsTheWindow) {
  const auto scene = load_scene(folder_with(scene_with(json::array({k_head}))));
  ASSERT_TRUE(scene) << scene.message();
  const PosedScene posed{{}, {{"head", "a", Pose{}}}};
  const auto done = [&](const ShowState& before, const Edit& edit) {
    const auto after = apply_edit(*scene, before, posed, edit);
    EXPECT_TRUE(after) << after.message();
    return after.value();
  };
  ShowState state = done(initial_show_state(*scene), {"window", "head", "20 5"});
  EXPECT_EQ(state.slots[0].window, (GreyWindow{5, 20}));
  state = done(state, {"save_look", "", "bright"});
  state = done(state, {"window", "head", ""});
  EXPECT_FALSE(state.slots[0].window);
  state = done(state, {"restore_look", "", "bright"});
  EXPECT_EQ(state.slots[0].window, (GreyWindow{5, 20}));
  const fs::path file = fs::path(testing::TempDir()) / "window.json";
  ASSERT_TRUE(write_file(file, look_json(state.looks[0])));
  const auto look = load_look(file, *scene);
  ASSERT_TRUE(look) << look.message();
  EXPECT_EQ(look->parts[0].window, (GreyWindow{5, 20}));
}

TEST(VolumePart, ASlotWithMeshesAloneHasNoWindow) {
  const auto scene =
      load_scene(folder_with(scene_with({{{"name", "a"}, {"mesh", "quad.obj"}, {"units", "m"}}})));
  ASSERT_TRUE(scene) << scene.message();
  const auto after = apply_edit(*scene, initial_show_state(*scene), {}, {"window", "head", "20 5"});
  ASSERT_FALSE(after);
  EXPECT_THAT(after.message(), HasSubstr("expected a slot with a volume"));
}

}  // namespace
}  // namespace limn::scene
