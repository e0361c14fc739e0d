#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>

#include "apps/export.h"
#include "core/camera_files/imager_file.h"
#include "core/file.h"
#include "core/rig.h"
#include "tests/support/matchers.h"

namespace limn::exchange {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
namespace fs = std::filesystem;

Imager bent_imager(const std::string& name, const std::string& model, std::vector<double> distortion) {
  std::vector<double> values = {700, 705, 640, 478};
  values.insert(values.end(), distortion.begin(), distortion.end());
  return {name, 1280, 960, Lens::create(model, values).value(), Pose()};
}

Imager fisheye_imager(const fs::path& folder) {
  const fs::path file = folder / "fisheye.yml";
  EXPECT_TRUE(write_file(
      file,
      "image_width: 1280\nimage_height: 960\nfisheye_model: 1\nK: [700, 0, 640, 0, 705, 478, 0, 0, 1]\n"
      "D: [-0.02, 0.006, -0.003, 0.0008]\n"));
  return load_imager(file).value();
}

// A rig with lenses of several models; camera1 is turned and moved.
class CameraExport : public testing::Test {
 protected:
  void SetUp() override {
    folder = test::test_folder();
    rig.cameras = {
        bent_imager("camera0", "LENSMODEL_OPENCV5", {-0.25, 0.08, 0.001, -0.0007, -0.01}),
        bent_imager("camera1", "LENSMODEL_OPENCV8", {0.1, -0.02, 0.001, 1e-5, 0.003, 0.3, -0.01, 0.002}),
        fisheye_imager(folder)};
    rig.cameras[1].imager_from_world = looking_at({0.4, -0.1, 1.0}, {0.1, 0, 0}, {0.2, 1, 0});
    rig.projectors = {bent_imager("projector0", "LENSMODEL_PINHOLE", {})};
    rig.projectors[0].imager_from_world = looking_at({-0.3, 0.2, 1.1}, {0, 0, 0}, {0, 1, 0});
    ASSERT_TRUE(save_rig(rig, folder / "rig"));
    options.rig = folder / "rig";
  }
  std::vector<Imager> imagers() const {
    return {rig.cameras[0], rig.cameras[1], rig.cameras[2], rig.projectors[0]};
  }

  fs::path folder;
  Rig rig;
  ExportOptions options;
};

// Largest distance of both lenses' pixels over the image.
double distance_px(const Lens& a, const Lens& b) {
  double worst = 0;
  for (double y = 0; y < 960; y += 60) {
    for (double x = 0; x < 1280; x += 60) {
      const auto d = a.unproject({x, y});
      const auto px = d ? b.project(*d) : std::nullopt;
      worst = std::max(worst, px ? (*px - Vector2d(x, y)).norm() : INFINITY);
    }
  }
  return worst;
}

TEST_F(CameraExport, OpencvAndRosFilesAreReadBackWithTheSamePixels) {
  options.opencv = folder / "opencv";
  options.ros = folder / "ros";
  const Status status = apps::run_export(options, true);
  ASSERT_TRUE(status) << status.message();
  for (const Imager& imager : imagers()) {
    const double most_px = imager.name == "fisheye" ? 0.05 : 1e-6;
    for (const fs::path& file :
         {options.opencv / (imager.name + ".yml"), options.ros / (imager.name + ".yaml")}) {
      const auto back = load_imager(file);
      ASSERT_TRUE(back) << back.message();
      EXPECT_EQ(back->width, 1280);
      EXPECT_EQ(back->height, 960);
      EXPECT_LT(distance_px(imager.lens, back->lens), most_px) << file;
    }
  }
}

TEST_F(CameraExport, ACamchainIsReadBackWithPixelsAndPoses) {
  rig.cameras[0] = bent_imager("camera0", "LENSMODEL_OPENCV4", {-0.25, 0.08, 0.001, -0.0007});
  const Pose camera_from_world = rig.cameras[1].imager_from_world;
  rig.cameras[1] = bent_imager("camera1", "LENSMODEL_OPENCV5", {-0.1, 0.02, 0.001, -0.0007, 0.0001});
  rig.cameras[1].imager_from_world = camera_from_world;
  ASSERT_TRUE(save_rig(rig, folder / "rig"));
  options.kalibr = folder / "camchain.yaml";
  const Status status = apps::run_export(options);
  ASSERT_TRUE(status) << status.message();
  for (std::size_t i = 0; i < imagers().size(); ++i) {
    const Imager imager = imagers()[i];
    const auto back = load_imager(options.kalibr.string() + ":cam" + std::to_string(i));
    ASSERT_TRUE(back) << back.message();
    EXPECT_LT(distance_px(imager.lens, back->lens), 0.11)
        << imager.name;  // Kalibr has four coefficients alone
    // Kalibr's world is cam0, whose pose in the rig is the identity.
    const Vector3d p(0.1, -0.2, 0.3);
    EXPECT_EQ(back->name, "cam" + std::to_string(i));
    EXPECT_TRUE(test::near(back->imager_from_world * p, imager.imager_from_world * p, 1e-9));
  }
}

TEST_F(CameraExport, OpencvReadsTheFilesItself) {
  options.opencv = folder / "opencv";
  ASSERT_TRUE(apps::run_export(options));
  for (const Imager& imager : imagers()) {
    const cv::FileStorage file((options.opencv / (imager.name + ".yml")).string(), cv::FileStorage::READ);
    cv::Mat matrix, distortion, pose;
    int is_fisheye = 0;
    file["camera_matrix"] >> matrix;
    file["distortion_coefficients"] >> distortion;
    file["camera_from_world"] >> pose;
    file["fisheye_model"] >> is_fisheye;
    EXPECT_EQ(is_fisheye, imager.name == "fisheye" ? 1 : 0);
    EXPECT_NEAR(pose.at<double>(2, 3), imager.imager_from_world.translation.z(), 1e-12);
    const std::vector<cv::Point3d> point = {{0.3, -0.25, 1}};
    std::vector<cv::Point2d> pixel;
    if (is_fisheye)
      cv::fisheye::projectPoints(point, pixel, cv::Vec3d(), cv::Vec3d(), matrix, distortion);
    else
      cv::projectPoints(point, cv::Vec3d(), cv::Vec3d(), matrix, distortion, pixel);
    const double tolerance_px = is_fisheye ? 0.05 : 1e-9;
    EXPECT_TRUE(test::near(imager.lens.project({0.3, -0.25, 1}).value(), Vector2d(pixel[0].x, pixel[0].y),
                           tolerance_px));
  }
}

TEST_F(CameraExport, ALensThatTheFormatCannotHoldIsRefused) {
  rig.cameras = {bent_imager("camera0", "LENSMODEL_OPENCV12", {0, 0, 0, 0, 0, 0, 0, 0, 0.2, 0.1, -0.2, 0.1})};
  ASSERT_TRUE(save_rig(rig, folder / "prism"));
  options.rig = folder / "prism";
  options.kalibr = folder / "camchain.yaml";
  const Status status = apps::run_export(options);
  ASSERT_FALSE(status);
  EXPECT_NE(status.message().find("camera0"), std::string::npos) << status.message();
  EXPECT_NE(status.message().find("px off"), std::string::npos) << status.message();
  EXPECT_FALSE(fs::exists(options.kalibr));
}

TEST_F(CameraExport, MapsStillNeedASceneAndPoses) {
  options.warp = folder / "warp";
  const Status status = apps::run_export(options);
  ASSERT_FALSE(status);
  EXPECT_TRUE(status.error().wrong_usage);
  EXPECT_NE(status.message().find("--scene and --poses"), std::string::npos) << status.message();
}

}  // namespace
}  // namespace limn::exchange
