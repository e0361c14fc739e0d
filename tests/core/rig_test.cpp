#include "core/rig.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

using namespace test::literals;

Imager imager(const std::string& name, const Pose& imager_from_world) {
  return {
      name, 1280, 800,
      Lens::create("LENSMODEL_OPENCV4", {1500.123456789, 1490, 630, 900, -0.15, 0.02, 0.001, -0.002}).value(),
      imager_from_world};
}

Rig two_devices() {
  Rig rig;
  rig.cameras = {imager("camera0", Pose())};
  rig.projectors = {imager("projector0", {exp_rotation({0.1, -0.7, 0.3}), {0.4, -0.1, 0.05}})};
  rig.provenance_json = R"({"captures":"here"})";
  return rig;
}

void expect_same(const Imager& found, const Imager& expected) {
  EXPECT_EQ(found.name, expected.name);
  EXPECT_EQ(found.width, expected.width);
  EXPECT_EQ(found.height, expected.height);
  EXPECT_EQ(found.lens.model.name(), expected.lens.model.name());
  for (std::size_t i = 0; i < expected.lens.values.size(); ++i) {
    EXPECT_NEAR(found.lens.values[i], expected.lens.values[i], 1e-6);  // mrcal writes ten digits
  }
  EXPECT_TRUE(test::pose_near(found.imager_from_world, expected.imager_from_world, 1e-9, 1e-9));
}

std::string load_message(const std::filesystem::path& path) {
  const auto rig = load_rig(path);
  return rig ? "" : rig.message();
}

TEST(Rig, SavedRigLoadsTheSame) {
  const auto folder = test::test_folder();
  ASSERT_TRUE(save_rig(two_devices(), folder));
  const auto rig = load_rig(folder);
  ASSERT_TRUE(rig) << rig.message();
  expect_same(rig->cameras.at(0), two_devices().cameras[0]);
  expect_same(rig->projectors.at(0), two_devices().projectors[0]);
  EXPECT_EQ(rig->provenance_json, two_devices().provenance_json);
}

TEST(Rig, AProjectorsFocusMayBeTold) {
  const auto folder = test::test_folder();
  Rig saved = two_devices();
  saved.focuses = {{"projector0", 1.25, 0.02}};
  ASSERT_TRUE(save_rig(saved, folder));
  const auto rig = load_rig(folder);
  ASSERT_TRUE(rig) << rig.message();
  ASSERT_EQ(rig->focuses.size(), 1u);
  EXPECT_EQ(rig->focuses[0].projector, "projector0");
  EXPECT_EQ(rig->focuses[0].distance_m, 1.25);
  EXPECT_EQ(rig->focuses[0].aperture_m, 0.02);
  for (const auto& [right, wrong, says] :
       {std::tuple{"\"aperture_m\": 0.02", "\"aperture_m\": -1", "projectors[0].focus.aperture_m"},
        {"\"distance_m\"", "\"distance_mm\"", "projectors[0].focus"}}) {
    std::string text = read_file(folder / "rig.json").value();
    text.replace(text.find(right), std::string(right).size(), wrong);
    const auto spoiled = folder / "spoiled.json";
    ASSERT_TRUE(write_file(spoiled, text));
    EXPECT_NE(load_message(spoiled).find(says), std::string::npos) << load_message(spoiled);
  }
  std::string text = read_file(folder / "rig.json").value();
  text.replace(text.find("\"cameras\""), 9, "\"lenses\"");
  text.replace(text.find("\"projectors\""), 12, "\"cameras\"");
  text.replace(text.find("\"lenses\""), 8, "\"projectors\"");
  ASSERT_TRUE(write_file(folder / "spoiled.json", text));
  EXPECT_NE(load_message(folder / "spoiled.json").find("cameras[0]: unknown key \"focus\""),
            std::string::npos)
      << load_message(folder / "spoiled.json");
}

TEST(Rig, AFolderOfCameramodelsAloneIsARig) {
  const auto folder = test::test_folder();
  ASSERT_TRUE(save_rig(two_devices(), folder));
  std::filesystem::remove(folder / "rig.json");
  const auto rig = load_rig(folder);
  ASSERT_TRUE(rig) << rig.message();
  ASSERT_EQ(rig->cameras.size(), 1u);
  ASSERT_EQ(rig->projectors.size(), 1u);
  expect_same(rig->projectors[0], two_devices().projectors[0]);
}

TEST(Rig, ResponseIsReadFromBesideTheRig) {
  const auto folder = test::test_folder();
  ASSERT_TRUE(save_rig(two_devices(), folder));
  ASSERT_TRUE(write_file(folder / "response.json", R"({"schema": "limn.response/1", "projectors": [
      {"name": "projector0", "red": [0, 0.2, 1], "green": [0, 0.2, 1], "blue": [0, 0.3, 1]}]})"));
  const auto rig = load_rig(folder);
  ASSERT_TRUE(rig) << rig.message();
  ASSERT_EQ(rig->responses.size(), 1u);
  EXPECT_EQ(rig->responses[0].blue[1], 0.3);
}

TEST(Rig, AWrongFocalLengthIsNamedWithItsPlace) {
  const auto folder = test::test_folder();
  ASSERT_TRUE(write_file(folder / "rig.json", R"({"schema": "limn.rig/1", "cameras": [], "projectors": [
      {"name": "projector0", "size": [1280, 800], "lens": {"model": "LENSMODEL_PINHOLE", "values": [-1, 1, 0, 0]},
       "imager_from_world": {"rotation_wxyz": [1, 0, 0, 0], "translation_m": [0, 0, 0]}}]})"));
  const std::string message = load_message(folder);
  EXPECT_NE(message.find("rig.json: projectors[0].lens"), std::string::npos) << message;
  EXPECT_NE(message.find("found -1"), std::string::npos) << message;
}

TEST(Rig, MissingFolderAndEmptyFolderAreTold) {
  EXPECT_NE(load_message(test::test_folder() / "nowhere").find("found nothing"), std::string::npos);
  EXPECT_NE(load_message(test::test_folder()).find("found neither"), std::string::npos);
}

TEST(Rig, ATruncatedCameramodelIsAnError) {
  const auto folder = test::test_folder();
  ASSERT_TRUE(save_cameramodel(two_devices().cameras[0], folder / "camera0.cameramodel"));
  const std::string text = read_file(folder / "camera0.cameramodel").value();
  ASSERT_TRUE(write_file(folder / "camera0.cameramodel", text.substr(0, text.size() / 2)));
  const auto loaded = load_cameramodel(folder / "camera0.cameramodel");
  ASSERT_FALSE(loaded);
  EXPECT_NE(loaded.message().find("truncated"), std::string::npos) << loaded.message();
}

TEST(Rig, WhatWasThereStaysWhenTheFolderCannotBeWritten) {
  if (::geteuid() == 0) {  // root can write everywhere, so a file in place of the folder must cause the error
    const auto path = test::test_folder() / "rig";
    ASSERT_TRUE(write_file(path, "old"));
    EXPECT_FALSE(save_rig(two_devices(), path));
    EXPECT_EQ(read_file(path).value(), "old");
    return;
  }
  const auto folder = test::test_folder();
  ::chmod(folder.c_str(), 0555);
  const auto status = save_rig(two_devices(), folder);
  ::chmod(folder.c_str(), 0755);
  ASSERT_FALSE(status);
  EXPECT_NE(status.message().find("writable"), std::string::npos) << status.message();
}

TEST(Rig, WhatACameraSeesIsKept) {
  Rig rig;
  for (const char* name : {"camera0", "camera1"})
    rig.cameras.push_back({name, 1280, 720, Lens::pinhole(900, 900, 639.5, 359.5), Pose()});
  EXPECT_EQ(rig.first_visible_camera(), 0u);
  rig.cameras[0].sees = Spectrum::infrared;
  const std::filesystem::path folder = test::test_folder() / "rig";
  ASSERT_TRUE(save_rig(rig, folder));
  const Rig loaded = load_rig(folder).value();
  EXPECT_EQ(loaded.cameras[0].sees, Spectrum::infrared);
  EXPECT_EQ(loaded.cameras[1].sees, Spectrum::visible);
  EXPECT_EQ(loaded.first_visible_camera(), 1u);
}

}  // namespace
}  // namespace limn
