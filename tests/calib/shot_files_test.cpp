#include "calib/shot_files.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <initializer_list>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

constexpr int k_images = 12;

bool is_series(int count) { return count == k_images; }

void make_files(const fs::path& folder, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    ASSERT_TRUE(make_folder((folder / name).parent_path()).ok());
    ASSERT_TRUE(write_file(folder / name, "x").ok());
  }
}

// Names of images: `form` with {0} the pose, {1} the image.
std::vector<std::string> names(const std::string& form, std::initializer_list<int> poses) {
  std::vector<std::string> all;
  for (const int pose : poses) {
    for (int image = 0; image < k_images; ++image)
      all.push_back(fmt::format(fmt::runtime(form), pose, image));
  }
  return all;
}

std::string name_of(const ShotFiles& shots, size_t pose, size_t camera, size_t image) {
  return shots.poses.at(pose).files.at(camera).at(image).filename().string();
}

TEST(ShotFiles, NumbersAreComparedAsNumbers) {
  EXPECT_TRUE(natural_less("pose2", "pose10"));
  EXPECT_TRUE(natural_less("pose2_cam10", "pose10_cam2"));
  EXPECT_TRUE(natural_less("a09", "a10"));
  EXPECT_TRUE(natural_less("a1.png", "a01.png") != natural_less("a01.png", "a1.png"));
  EXPECT_FALSE(natural_less("pose10", "pose2"));
  EXPECT_FALSE(natural_less("pose2", "pose2"));
  EXPECT_TRUE(natural_less("pose", "pose2"));
}

TEST(ShotFiles, OfPoseFoldersAreSortedByNumber) {
  const fs::path folder = test::test_folder();
  make_files(folder, names("capture_{}/gray_{}.png", {0, 2, 10}));
  make_files(folder, {"capture_2/notes.txt", "capture_2/thumb.db"});
  const auto shots = find_shots({.folder = folder, .poses = "capture_*"}, is_series);
  ASSERT_TRUE(shots.ok()) << shots.message();
  ASSERT_EQ(shots->poses.size(), 3U);
  EXPECT_EQ(shots->poses[2].name, "capture_10");
  EXPECT_EQ(shots->poses[1].files[0].size(), 12U);
  EXPECT_EQ(name_of(*shots, 1, 0, 10), "gray_10.png");
  EXPECT_EQ(shots->cameras, std::vector<std::string>{"camera0"});
}

TEST(ShotFiles, OfAFlatFolderAreGroupedByPose) {
  const fs::path folder = test::test_folder();
  make_files(folder, names("pose{}_cam0_{:02}.JPG", {1, 2, 10}));
  const auto shots = find_shots({.folder = folder}, is_series);
  ASSERT_TRUE(shots.ok()) << shots.message();
  ASSERT_EQ(shots->poses.size(), 3U);
  EXPECT_EQ(shots->poses[0].name, "pose1_cam0");
  EXPECT_EQ(name_of(*shots, 2, 0, 11), "pose10_cam0_11.JPG");
  const auto skipped = find_shots({.folder = folder, .skip = {"pose2_cam0"}}, is_series);
  ASSERT_TRUE(skipped.ok()) << skipped.message();
  EXPECT_EQ(skipped->poses.size(), 2U);
}

TEST(ShotFiles, MayHaveTheImagesNumberBeforeThePoses) {
  const fs::path folder = test::test_folder();
  make_files(folder, names("{1:02}_pose{0}.png", {0, 1, 2, 3}));
  const auto shots = find_shots({.folder = folder}, is_series);
  ASSERT_TRUE(shots.ok()) << shots.message();
  ASSERT_EQ(shots->poses.size(), 4U);
  EXPECT_EQ(name_of(*shots, 3, 0, 5), "05_pose3.png");
}

TEST(ShotFiles, OfOneLongSeriesAreCut) {
  const fs::path folder = test::test_folder();
  std::vector<std::string> all;
  for (int i = 0; i < 3 * k_images; ++i) all.push_back(fmt::format("DSC{}.jpg", 1000 + i));
  make_files(folder, all);
  const auto shots = find_shots({.folder = folder}, is_series);
  ASSERT_TRUE(shots.ok()) << shots.message();
  ASSERT_EQ(shots->poses.size(), 3U);
  EXPECT_EQ(name_of(*shots, 2, 0, 0), "DSC1024.jpg");
}

TEST(ShotFiles, OfTwoCamerasAreFoundByTwoPatterns) {
  const fs::path folder = test::test_folder();
  make_files(folder, names("pose{}/left_{}.png", {1, 2}));
  make_files(folder, names("pose{}/right_{}.png", {1, 2}));
  for (const char* patterns : {"left_*.png,right_*.png", "a=left_*,b=right_*", "*.png"}) {
    const auto shots = find_shots({.folder = folder, .shots = patterns}, is_series);
    ASSERT_TRUE(shots.ok()) << shots.message();
    ASSERT_EQ(shots->cameras.size(), 2U) << patterns;
    EXPECT_EQ(shots->cameras[1], patterns[1] == '=' ? "b" : "camera1");
    EXPECT_EQ(name_of(*shots, 1, 1, 10), "right_10.png");
  }
}

TEST(ShotFiles, OfTwoCamerasInAFlatFolderAreFound) {
  const fs::path folder = test::test_folder();
  make_files(folder, names("cam0_p{}_{}.png", {1, 2, 3}));
  make_files(folder, names("cam1_p{}_{}.png", {1, 2, 3}));
  for (const char* patterns : {"cam0_*.png,cam1_*.png", "*"}) {
    const auto shots = find_shots({.folder = folder, .shots = patterns}, is_series);
    ASSERT_TRUE(shots.ok()) << shots.message();
    ASSERT_EQ(shots->cameras.size(), 2U);
    ASSERT_EQ(shots->poses.size(), 3U);
    EXPECT_EQ(shots->poses[1].name, "p2");
    EXPECT_EQ(name_of(*shots, 1, 1, 3), "cam1_p2_3.png");
  }
}

TEST(ShotFiles, SayWhichPoseOneCameraLacks) {
  const fs::path folder = test::test_folder();
  make_files(folder, names("left_{}_{}.png", {1, 2, 3}));
  make_files(folder, names("right_{}_{}.png", {1, 3}));
  const auto shots = find_shots({.folder = folder}, is_series);
  ASSERT_FALSE(shots.ok());
  EXPECT_NE(shots.message().find("same poses"), std::string::npos) << shots.message();
  const auto none = find_shots({.folder = folder, .shots = "img_*.png"}, is_series);
  ASSERT_FALSE(none.ok());
  EXPECT_NE(none.message().find("img_*.png"), std::string::npos) << none.message();
  EXPECT_NE(find_shots({.folder = folder / "absent"}, is_series).message().find("absent"), std::string::npos);
}

}  // namespace
}  // namespace limn::calib
