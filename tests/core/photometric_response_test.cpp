#include "core/photometric_response.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "core/rig.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

RigResponses some_responses() {
  ProjectorResponse projector{"projector0", {0.01, 0.2, 1}, {0.01, 0.3, 1}, {0.01, 0.4, 1}};
  projector.black_level = Measurement{0.01, 0.0002};
  projector.vignetting = Vignetting{{0.1, -0.05}, -0.2, 0.01, 0.004};
  projector.white_over_sum = 1.02;
  projector.captures = 57;
  CameraResponse camera;
  camera.camera = "camera0";
  camera.encoding = CameraEncoding::gamma;
  camera.gamma = 2.2;
  camera.noise_dark = 0.7;
  for (int i = 0; i < 256; ++i) camera.light.push_back(std::pow(i / 255.0, 2.2));
  return {{projector}, {camera}};
}

ColourMixing some_mixing() {
  ColourMixing mixing{"projector0", "camera0", {}, {}, {}, {}, 0.75};
  float value = 0.05F;
  for (cv::Mat* map : {&mixing.red, &mixing.green, &mixing.blue, &mixing.offset}) {
    map->create(5, 7, CV_32FC3);
    map->setTo(cv::Scalar(value, 2 * value, 3 * value));
    map->at<cv::Vec3f>(2, 3)[1] = std::numeric_limits<float>::quiet_NaN();
    value += 0.1F;
  }
  return mixing;
}

TEST(PhotometricResponse, IsReadAsItWasWritten) {
  const auto folder = test::test_folder();
  const Status saved = save_responses(some_responses(), {some_mixing()}, folder);
  ASSERT_TRUE(saved.ok()) << saved.message();
  const auto read = load_responses(folder / "response.json");
  ASSERT_TRUE(read.ok()) << read.message();
  const ProjectorResponse &found = read->projectors.at(0), expected = some_responses().projectors[0];
  EXPECT_EQ(found.projector, "projector0");
  EXPECT_EQ(found.green, expected.green);
  EXPECT_EQ(found.black_level->stddev, 0.0002);
  EXPECT_EQ(found.vignetting->tilt, expected.vignetting->tilt);
  EXPECT_EQ(found.white_over_sum, 1.02);
  EXPECT_FALSE(found.drift.has_value());
  EXPECT_EQ(found.captures, 57);
  EXPECT_EQ(read->cameras.at(0).encoding, CameraEncoding::gamma);
  EXPECT_NEAR(read->cameras[0].light[100], std::pow(100 / 255.0, 2.2), 1e-7);
}

TEST(PhotometricResponse, MixingMapsKeepTheirValuesWithinTheirUnit) {
  const auto folder = test::test_folder();
  ASSERT_TRUE(save_responses(some_responses(), {some_mixing()}, folder).ok());
  const auto read = load_mixing(folder / "response.json", "projector0", "camera0");
  ASSERT_TRUE(read.ok()) << read.message();
  const ColourMixing expected = some_mixing();
  EXPECT_EQ(read->held_out_levels, 0.75);
  EXPECT_NEAR(read->blue.at<cv::Vec3f>(1, 1)[2], expected.blue.at<cv::Vec3f>(1, 1)[2], 0.5 / 4096);
  EXPECT_NEAR(read->offset.at<cv::Vec3f>(4, 6)[0], expected.offset.at<cv::Vec3f>(4, 6)[0], 0.5 / 4096);
  EXPECT_TRUE(std::isnan(read->red.at<cv::Vec3f>(2, 3)[1]));
  EXPECT_NE(load_mixing(folder / "response.json", "projector7", "camera0").message().find("projector7"),
            std::string::npos);
  ASSERT_TRUE(
      write_png(folder / "response/projector0-camera0-red.png", cv::Mat(3, 3, CV_8U, cv::Scalar(1))).ok());
  EXPECT_NE(load_mixing(folder / "response.json", "projector0", "camera0").message().find("camera0-red.png"),
            std::string::npos);
}

TEST(PhotometricResponse, ComesWithTheRigEvenWithoutARigFile) {
  const auto folder = test::test_folder();
  Rig rig;
  rig.cameras = {{"camera0", 640, 480, Lens::pinhole(500, 500, 320, 240), Pose()}};
  ASSERT_TRUE(save_rig(rig, folder).ok());
  ASSERT_TRUE(save_responses(some_responses(), {}, folder).ok());
  EXPECT_EQ(load_rig(folder)->responses.size(), 1U);
  std::filesystem::remove(folder / "rig.json");
  const auto alone = load_rig(folder);
  ASSERT_TRUE(alone.ok()) << alone.message();
  EXPECT_EQ(alone->responses.at(0).red, some_responses().projectors[0].red);
  EXPECT_EQ(alone->camera_responses.at(0).encoding, CameraEncoding::gamma);
}

TEST(PhotometricResponse, AFallingCurveIsNamed) {
  const auto path = test::test_folder() / "response.json";
  ASSERT_TRUE(write_file(path, R"({"schema": "limn.response/1", "projectors": [
      {"name": "projector0", "red": [0, 0.2, 1], "green": [0, 0.5, 0.3], "blue": [0, 1]}]})")
                  .ok());
  const auto read = load_responses(path);
  ASSERT_FALSE(read.ok());
  EXPECT_NE(read.message().find("projectors[0]"), std::string::npos) << read.message();
  EXPECT_NE(read.message().find("never fall"), std::string::npos) << read.message();
}

TEST(PhotometricResponse, VignettingIsOneInTheMiddleAndFallsToTheCorners) {
  const Vignetting vignetting{{0.1, 0}, -0.3, 0.05, 0};
  EXPECT_NEAR(vignetting.gain({319.5, 239.5}, 640, 480), 1, 1e-12);
  EXPECT_NEAR(vignetting.gain({639.5, 479.5}, 640, 480), 1 + 0.1 * 0.8 - 0.3 + 0.05, 1e-12);
  EXPECT_NEAR(vignetting.gain({-0.5, 479.5}, 640, 480), 1 - 0.1 * 0.8 - 0.3 + 0.05, 1e-12);
}

TEST(PhotometricResponse, TablesAreLookedUpBothWays) {
  const std::vector<double> table = {0.1, 0.1, 0.4, 1};
  for (const double at : {0.4, 0.5, 0.8, 1.0})
    EXPECT_NEAR(inverse_lookup(table, lookup(table, at)), at, 1e-12);
  EXPECT_EQ(inverse_lookup(table, 0.05), 0);
  EXPECT_EQ(inverse_lookup(table, 2), 1);
  for (const double light : {0.0, 0.001, 0.2, 1.0})
    EXPECT_NEAR(linear_from_srgb(srgb_from_linear(light)), light, 1e-6);
}

}  // namespace
}  // namespace limn
