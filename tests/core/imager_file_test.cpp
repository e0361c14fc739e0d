#include "core/camera_files/imager_file.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

TEST(ImagerFile, ReadsAnOpenCvCamera) {
  const auto path = test::test_folder() / "camera.yml";
  ASSERT_TRUE(write_file(path, R"(%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 450., 0., 317., 0., 456., 277., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0.12, -1.08, 0.0001, -0.0004, 2.95 ]
)"));
  const auto camera = load_imager(path);
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ(camera->width, 640);
  EXPECT_EQ(camera->lens.model.name(), "LENSMODEL_OPENCV5");
  EXPECT_EQ(camera->lens.values,
            (std::vector<double>{450, 456, 317, 277, 0.12, -1.08, 0.0001, -0.0004, 2.95}));
}

TEST(Imager, HalfTheResolutionSeesTheSameRays) {
  const Imager whole{
      "c", 640, 480, Lens::create("LENSMODEL_OPENCV4", {700, 710, 320, 240, -0.1, 0, 0, 0}).value(), {}};
  const auto half = resized(whole, 320, 240);
  ASSERT_TRUE(half);
  const Eigen::Vector3d p(0.2, -0.1, 1);  // the image's left edge stays at -0.5 px
  EXPECT_TRUE(test::near(half->project(p)->array() + 0.5, (whole.project(p)->array() + 0.5) / 2, 1e-9));
  EXPECT_FALSE(resized(whole, 320, 320));
}

std::string big_endian(std::uint64_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 0xff);
  return text;
}

std::string artoolkit_file(const std::vector<double>& matrix, const std::vector<double>& factors) {
  std::string bytes = big_endian(640, 4) + big_endian(480, 4);
  for (const auto* numbers : {&matrix, &factors}) {
    for (const double number : *numbers) bytes += big_endian(std::bit_cast<std::uint64_t>(number), 8);
  }
  return bytes;
}

const std::vector<double> k_matrix = {700, 0, 320, 0, 0, 705, 240, 0, 0, 0, 1, 0};

TEST(ImagerFile, ReadsArtoolkitVersion4AsTheSameLens) {
  const auto path = test::test_folder() / "camera_para.dat";
  // With scale 1.02 the matrix contains fx / scale, which means an OpenCV lens of focal lengths 714 and
  // 719.1.
  ASSERT_TRUE(
      write_file(path, artoolkit_file(k_matrix, {0.1, -0.5, 0.001, -0.002, 714, 719.1, 320, 240, 1.02})));
  const auto camera = load_imager(path);
  ASSERT_TRUE(camera) << camera.message();
  const Lens expected =
      Lens::create("LENSMODEL_OPENCV4", {714, 719.1, 320, 240, 0.1, -0.5, 0.001, -0.002}).value();
  for (double x = -0.4; x <= 0.4; x += 0.2) {
    const Eigen::Vector3d p(x, 0.7 * x, 1);
    EXPECT_TRUE(test::near(*camera->lens.project(p), *expected.project(p), 1e-3));
  }
}

TEST(ImagerFile, RefitsArtoolkitVersion1) {
  const auto path = test::test_folder() / "camera_para.dat";
  ASSERT_TRUE(write_file(path, artoolkit_file(k_matrix, {318.5, 263.5, 26.2, 1.012757})));
  const auto camera = load_imager(path);
  ASSERT_TRUE(camera) << camera.message();
  // The ideal pixel (500, 100), computed by hand: n = 1.012757 * (181.5, -163.5), r2 = 61206, factor 1
  // - 26.2e-8 * r2.
  const Eigen::Vector3d p((500 - 320) / 700.0, (100 - 240) / 705.0, 1);
  const Eigen::Vector2d n = 1.012757 * Eigen::Vector2d(181.5, -163.5);
  const Eigen::Vector2d expected = n * (1 - 26.2e-8 * n.squaredNorm()) + Eigen::Vector2d(318.5, 263.5);
  EXPECT_TRUE(test::near(*camera->lens.project(p), expected, 0.1));
}

TEST(ImagerFile, DamagedFilesAreNamed) {
  const auto folder = test::test_folder();
  const auto message_of = [&](const std::string& name, const std::string& content) {
    EXPECT_TRUE(write_file(folder / name, content));
    const auto camera = load_imager(folder / name);
    return camera ? std::string() : camera.message();
  };
  EXPECT_NE(message_of("short.dat", artoolkit_file(k_matrix, {1, 2})).find("found 120 bytes"),
            std::string::npos);
  EXPECT_NE(message_of("nan.dat", artoolkit_file(k_matrix, {1, 2, std::nan(""), 1})).find("nan.dat"),
            std::string::npos);
  EXPECT_NE(
      message_of("cut.yml", "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3").find("cut.yml"),
      std::string::npos);
  EXPECT_NE(message_of("else.txt", "hello").find("expected a camera"), std::string::npos);
  EXPECT_NE(message_of("empty.yml", "").find("expected a camera"), std::string::npos);
}

TEST(ImagerFile, ReadsTheRealFiles) {
  const auto data = test::real_data("markers");
  if (!data) GTEST_SKIP() << "no real data: markers";
  for (const char* name : {"artoolkit/camera_para.dat", "artoolkit/hiro_frame_camera_para.dat",
                           "opencv/tutorial_camera_params.yml", "opencv/tutorial_camera_charuco.yml"}) {
    const auto camera = load_imager(*data / name);
    ASSERT_TRUE(camera) << camera.message();
    EXPECT_GT(camera->lens.fx(), 400);
  }
}

}  // namespace
}  // namespace limn
