// Camera files of other programs: every spelling gives the same projection, and what is not understood is
// named.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <opencv2/calib3d.hpp>

#include "core/camera_files/imager_file.h"
#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// The camera of all files below: fx, fy, cx, cy and OpenCV's coefficients.
constexpr double k_fx = 700, k_fy = 705, k_cx = 640, k_cy = 478;
const std::vector<double> k_radial = {-0.25, 0.08, 0.001, -0.0007, -0.01};
const std::vector<double> k_fisheye = {-0.02, 0.006, -0.003, 0.0008};

const std::string k_size = "image_width: 1280\nimage_height: 960\n";
const std::string k_matrix =
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 700., 0., 640., 0., 705., 478., 0., 0., 1. ]\n";
const std::string k_head = "%YAML:1.0\n---\n";
const std::string k_lists = R"([[700.0, 0.0, 640.0], [0.0, 705.0, 478.0], [0.0, 0.0, 1.0]])";

std::string coefficients(const std::string& list, int rows = 1, int columns = 5) {
  return fmt::format(
      "distortion_coefficients: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [ {} ]\n", rows,
      columns, list);
}
const std::string k_five = "-0.25, 0.08, 0.001, -0.0007, -0.01";
const std::string k_four = "-0.02, 0.006, -0.003, 0.0008";

std::string utf16(const std::string& text, bool is_little) {
  std::string wide = is_little ? "\xff\xfe" : "\xfe\xff";
  for (const char c : text) wide += is_little ? std::string{c, '\0'} : std::string{'\0', c};
  return wide;
}

std::string with_crlf(const std::string& text) {
  std::string lines;
  for (const char c : text) lines += c == '\n' ? std::string("\r\n") : std::string{c};
  return lines;
}

Result<Imager> loaded(const std::string& name, const std::string& text, const std::string& camera = "") {
  const auto path = test::test_folder() / name;
  EXPECT_TRUE(write_file(path, text));
  return load_imager(camera.empty() ? path : std::filesystem::path(path.string() + ":" + camera));
}

std::string message_of(const std::string& name, const std::string& text, const std::string& camera = "") {
  const auto imager = loaded(name, text, camera);
  return imager ? "read as " + imager->lens.model.name() : imager.message();
}

// OpenCV's pixels of points over the whole image.
std::vector<std::pair<Vector3d, Vector2d>> opencv_pixels(const std::vector<double>& distortion,
                                                         bool is_fisheye) {
  std::vector<cv::Point3d> points;
  for (double y = -0.62; y <= 0.62; y += 0.1)
    for (double x = -0.85; x <= 0.85; x += 0.1) points.emplace_back(x, y, 1);
  const cv::Matx33d matrix(k_fx, 0, k_cx, 0, k_fy, k_cy, 0, 0, 1);
  std::vector<cv::Point2d> pixels;
  const cv::Vec3d none(0, 0, 0);
  if (is_fisheye)
    cv::fisheye::projectPoints(points, pixels, none, none, matrix, distortion);
  else
    cv::projectPoints(points, none, none, matrix, distortion, pixels);
  std::vector<std::pair<Vector3d, Vector2d>> pairs;
  for (std::size_t i = 0; i < points.size(); ++i)
    pairs.emplace_back(Vector3d(points[i].x, points[i].y, 1), Vector2d(pixels[i].x, pixels[i].y));
  return pairs;
}

void expect_pixels(const Imager& imager,
                   const std::vector<double>& distortion,
                   bool is_fisheye,
                   double tolerance_px) {
  for (const auto& [p, px] : opencv_pixels(distortion, is_fisheye)) {
    const auto found = imager.lens.project(p);
    ASSERT_TRUE(found) << p.transpose();
    ASSERT_TRUE(test::near(*found, px, tolerance_px)) << imager.lens.model.name() << " at " << p.transpose();
  }
}

struct CameraFile {
  const char* name;
  std::string text;
  bool has_size = true;
};
std::ostream& operator<<(std::ostream& out, const CameraFile& file) { return out << file.name; }
std::string test_name(const testing::TestParamInfo<CameraFile>& file) { return file.param.name; }

struct RadialCameraFile : testing::TestWithParam<CameraFile> {};

TEST_P(RadialCameraFile, HasOpencvsPixels) {
  const auto imager = loaded(std::string(GetParam().name) + ".txt", GetParam().text);
  ASSERT_TRUE(imager) << imager.message();
  expect_pixels(*imager, k_radial, false, 1e-6);
  EXPECT_EQ(imager->width, GetParam().has_size ? 1280 : 0);
  EXPECT_EQ(imager->height, GetParam().has_size ? 960 : 0);
}

const std::string k_opencv = k_head + k_size + k_matrix + coefficients(k_five);
const std::string k_ros = k_size + R"(camera_name: cam
camera_matrix:
  rows: 3
  cols: 3
  data: [700.0, 0.0, 640.0, 0.0, 705.0, 478.0, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.25, 0.08, 0.001, -0.0007, -0.01]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [650.0, 0.0, 630.0, 0.0, 0.0, 660.0, 470.0, 0.0, 0.0, 0.0, 1.0, 0.0]
)";
const std::string k_ros_message = R"(header:
  seq: 3
  stamp: {secs: 1, nsecs: 2}
  frame_id: "cam"
height: 960
width: 1280
distortion_model: "plumb_bob"
D: [-0.25, 0.08, 0.001, -0.0007, -0.01]
K: [700.0, 0.0, 640.0, 0.0, 705.0, 478.0, 0.0, 0.0, 1.0]
R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
P: [650.0, 0.0, 630.0, 0.0, 0.0, 660.0, 470.0, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi:
  x_offset: 0
  y_offset: 0
  height: 0
  width: 0
  do_rectify: False
---
header:
  seq: 4
)";
const std::string k_xml_matrix =
    "<camera_matrix type_id=\"opencv-matrix\"><rows>3</rows><cols>3</cols><dt>d</dt><data>\n 700. 0. 640. 0. "
    "705. 478. 0. 0. "
    "1.</data></camera_matrix>\n";

INSTANTIATE_TEST_SUITE_P(
    Spellings,
    RadialCameraFile,
    testing::Values(
        CameraFile{"opencv", k_opencv},
        CameraFile{"opencv_without_head", k_size + k_matrix + coefficients(k_five)},
        CameraFile{"opencv_vector",
                   k_head + k_size + k_matrix + "distortion_coefficients: [ " + k_five + " ]\n"},
        CameraFile{
            "opencv_block",
            k_head + k_size + k_matrix +
                "distortion_coefficients:\n   - -0.25\n   - 0.08\n   - 0.001\n   - -0.0007\n   - -0.01\n"},
        CameraFile{"opencv_column", k_head + k_size + k_matrix + coefficients(k_five, 5, 1)},
        CameraFile{"opencv_14",
                   k_head + k_size + k_matrix + coefficients(k_five + ", 0, 0, 0, 0, 0, 0, 0, 0, 0", 1, 14)},
        CameraFile{"opencv_other_name", k_head + k_size + k_matrix + "dist_coeffs: [ " + k_five + " ]\n"},
        CameraFile{"opencv_sample",
                   k_head + "calibration_time: \"Wed 1 Jan 2020 # 12:00:00\"\nnframes: 12\n" + k_size +
                       "board_width: 9\nboard_height: 6\nsquare_size: 2.5\naspectRatio: 1.\nflags: 2\n" +
                       k_matrix + coefficients(k_five) +
                       "avg_reprojection_error: 0.3\nper_view_reprojection_errors: [ 0.1, 0.2 ]\n"},
        CameraFile{"opencv_tutorial",
                   k_head +
                       "calibration_Time: \"now\"\nimage_Width: 1280\nimage_Height: 960\nfisheye_model: 0\n"
                       "Camera_Matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 700., "
                       "0., 640.,\n"
                       "       0., 705., 478., 0., 0., 1. ]\nDistortion_Coefficients: !!opencv-matrix\n   "
                       "rows: 5\n   "
                       "cols: 1\n   dt: d\n   data: [ " +
                       k_five + " ]\n"},
        CameraFile{
            "opencv_xml",
            "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>1280</image_width>\n<image_height>960"
            "</image_height>\n" +
                k_xml_matrix + "<distCoeffs>-0.25 0.08 0.001 -0.0007 -0.01</distCoeffs></opencv_storage>\n"},
        CameraFile{
            "opencv_json",
            R"({"image_width": 1280, "image_height": 960, "cameraMatrix": {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d", "data": [700.0, 0, 640, 0, 705, 478, 0, 0, 1]}, "distCoeffs": [-0.25, 0.08, 0.001, -0.0007, -0.01]})"},
        CameraFile{"nested", k_head + "calibration:\n  image_width: 1280\n  image_height: 960\n  K: " +
                                 k_lists + "\n  D: [" + k_five + "]\n"},
        CameraFile{"utf16_little", utf16(k_opencv, true)},
        CameraFile{"utf16_big", utf16(k_opencv, false)},
        CameraFile{"byte_order_mark_and_crlf", "\xef\xbb\xbf" + with_crlf(k_opencv)}),
    test_name);

INSTANTIATE_TEST_SUITE_P(
    Programs,
    RadialCameraFile,
    testing::Values(
        CameraFile{"ros", k_ros},
        CameraFile{"ros_message", k_ros_message},
        CameraFile{"ros2_message",
                   "height: 960\nwidth: 1280\ndistortion_model: plumb_bob\nd:\n- -0.25\n- 0.08\n- 0.001\n- "
                   "-0.0007\n- "
                   "-0.01\nk:\n- 700.0\n- 0.0\n- 640.0\n- 0.0\n- 705.0\n- 478.0\n- 0.0\n- 0.0\n- 1.0\n---\n"},
        CameraFile{
            "ros2_parameters",
            "/**:\n  ros__parameters:\n    image_width: 1280\n    image_height: 960\n    "
            "distortion_model: rational_polynomial\n    camera_matrix:\n      data: [700.0, 0.0, 640.0, "
            "0.0, 705.0, 478.0, 0.0, 0.0, 1.0]\n    distortion_coefficients:\n      data: [" +
                k_five + ", 0.0, 0.0, 0.0]\n"},
        CameraFile{"numpy_json", R"({"camera_matrix": )" + k_lists + R"(, "dist_coeff": [[)" + k_five + "]]}",
                   false},
        CameraFile{
            "numpy_column",
            R"({"mtx": )" + k_lists +
                R"(, "dist": [[-0.25], [0.08], [0.001], [-0.0007], [-0.01]], "img_shape": [960, 1280]})"},
        CameraFile{
            "photonvision",
            R"({"resolution": {"width": 1280.0, "height": 960.0}, "cameraIntrinsics": {"rows": 3, "cols": 3, "type": 6, "data": [700.0, 0.0, 640.0, 0.0, 705.0, 478.0, 0.0, 0.0, 1.0]}, "distCoeffs": {"rows": 1, "cols": 5, "type": 6, "data": [-0.25, 0.08, 0.001, -0.0007, -0.01]}, "calobjectWarp": [0.1, 0.2], "lensmodel": "LENSMODEL_OPENCV"})"},
        CameraFile{
            "photonvision_2023",
            R"({"resolution": {"width": 1280.0, "height": 960.0}, "cameraIntrinsics": {"rows": 3, "cols": 3, "type": 6, "data": [700.0, 0.0, 640.0, 0.0, 705.0, 478.0, 0.0, 0.0, 1.0]}, "cameraExtrinsics": {"rows": 1, "cols": 5, "type": 6, "data": [-0.25, 0.08, 0.001, -0.0007, -0.01]}, "standardDeviation": 0.2})"},
        CameraFile{"orb_slam",
                   k_head +
                       "Camera.type: \"PinHole\"\nCamera.fx: 700.\nCamera.fy: 705.\nCamera.cx: 640.\n"
                       "Camera.cy: 478.\nCamera.k1: -0.25\nCamera.k2: 0.08\nCamera.p1: 0.001\nCamera.p2: "
                       "-0.0007\nCamera.k3: -0.01\nCamera.width: 1280\nCamera.height: 960\nCamera.fps: 30.0\n"
                       "Camera.RGB: 1\nThDepth: 40.0\nORBextractor.nFeatures: 1000\n"},
        CameraFile{
            "orb_slam3",
            k_head +
                "File.version: \"1.0\"\nCamera.type: \"PinHole\"\nCamera1.fx: 700.\nCamera1.fy: 705.\n"
                "Camera1.cx: 640.\nCamera1.cy: 478.\nCamera1.k1: -0.25\nCamera1.k2: 0.08\nCamera1.p1: "
                "0.001\nCamera1.p2: -0.0007\nCamera1.k3: -0.01\nCamera.width: 1280\nCamera.height: 960\n"},
        CameraFile{
            "realsense",
            R"({"width": 1280, "height": 960, "ppx": 640, "ppy": 478, "fx": 700, "fy": 705, "model": "distortion.brown_conrady", "coeffs": [-0.25, 0.08, 0.001, -0.0007, -0.01]})"},
        CameraFile{
            "depthai",
            R"({"batchName": "", "cameraData": [[0, {"cameraType": 0, "distortionCoeff": [-0.25, 0.08, 0.001, -0.0007, -0.01, 0, 0, 0, 0, 0, 0, 0, 0, 0], "extrinsics": {"rotationMatrix": [[1,0,0],[0,1,0],[0,0,1]], "toCameraSocket": 1}, "intrinsicMatrix": )" +
                k_lists + R"(, "width": 1280, "height": 960, "lensPosition": 130}]]})"}),
    test_name);

struct FisheyeCameraFile : testing::TestWithParam<CameraFile> {};

TEST_P(FisheyeCameraFile, HasOpencvsPixels) {
  const auto imager = loaded(std::string(GetParam().name) + ".txt", GetParam().text);
  ASSERT_TRUE(imager) << imager.message();
  expect_pixels(*imager, k_fisheye, true, 0.02);
  EXPECT_EQ(imager->width, GetParam().has_size ? 1280 : 0);
}

const std::string k_pinhole_list = "  intrinsics: [700.0, 705.0, 640.0, 478.0]\n  resolution: [1280, 960]\n";

INSTANTIATE_TEST_SUITE_P(
    Programs,
    FisheyeCameraFile,
    testing::Values(
        CameraFile{"opencv", k_head + k_size + "fisheye_model: 1\n" + k_matrix + coefficients(k_four, 4, 1)},
        CameraFile{"opencv_without_size",
                   k_head + "fisheye_model: 1\n" + k_matrix + coefficients(k_four, 4, 1), false},
        CameraFile{"opencv_named", k_head + k_size + k_matrix + "distortion_model: \"equidistant\"\n" +
                                       coefficients(k_four, 1, 4)},
        CameraFile{"kalibr",
                   "cam0:\n  camera_model: pinhole\n  distortion_model: equi\n  distortion_coeffs: [" +
                       k_four + "]\n" + k_pinhole_list},
        CameraFile{
            "orb_slam3",
            k_head + "Camera.type: \"KannalaBrandt8\"\nCamera1.fx: 700.\nCamera1.fy: 705.\nCamera1.cx: 640.\n"
                     "Camera1.cy: 478.\nCamera1.k1: -0.02\nCamera1.k2: 0.006\nCamera1.k3: -0.003\n"
                     "Camera1.k4: 0.0008\nCamera.width: 1280\nCamera.height: 960\n"},
        CameraFile{"vins", k_head + "model_type: KANNALA_BRANDT\ncamera_name: cam0\n" + k_size +
                               "projection_parameters:\n   k2: -0.02\n   k3: 0.006\n   k4: -0.003\n   k5: "
                               "0.0008\n   mu: 700\n   "
                               "mv: 705\n   u0: 640\n   v0: 478\n"},
        CameraFile{
            "mc_calib",
            k_head +
                "nb_camera: 1\ncamera_0:\n   camera_matrix: !!opencv-matrix\n      rows: 3\n      cols: "
                "3\n      dt: d\n      data: [ 700., 0., 640., 0., 705., 478., 0., 0., 1. ]\n   "
                "distortion_vector: !!opencv-matrix\n      rows: 1\n      cols: 4\n      dt: d\n      "
                "data: [ " +
                k_four + " ]\n   distortion_type: 1\n   img_width: 1280\n   img_height: 960\n"}),
    test_name);

// The closed formula (Kannala and Brandt), for any angle off the axis.
Vector2d fisheye_pixel(
    double focal, const Vector2d& centre, const std::vector<double>& k, double angle, double azimuth) {
  const double a2 = angle * angle;
  const double bent =
      angle * (1 + k[0] * a2 + k[1] * a2 * a2 + k[2] * a2 * a2 * a2 + k[3] * a2 * a2 * a2 * a2);
  return centre + focal * bent * Vector2d(std::cos(azimuth), std::sin(azimuth));
}

TEST(CameraFiles, AFisheyeOf200DegreesKeepsItsPixelsAndDirections) {
  const std::string text = k_size + "fisheye_model: 1\ncamera_matrix: [330, 0, 655, 0, 330, 470, 0, 0, 1]\n" +
                           coefficients("0.03, -0.01, 0.004, -0.0006", 1, 4);
  const auto imager = loaded("wide.yml", text);
  ASSERT_TRUE(imager) << imager.message();
  int count = 0;
  double worst_px = 0, worst_angle = 0;
  for (double angle = 0; angle < 1.74; angle += 0.02) {  // 100 degrees
    for (double azimuth = 0; azimuth < 6.28; azimuth += 0.1) {
      const Vector2d px = fisheye_pixel(330, {655, 470}, {0.03, -0.01, 0.004, -0.0006}, angle, azimuth);
      if (!imager->contains(px)) continue;
      const Vector3d d(std::sin(angle) * std::cos(azimuth), std::sin(angle) * std::sin(azimuth),
                       std::cos(angle));
      const auto found = imager->lens.project(d);
      const auto back = imager->lens.unproject(px);
      ASSERT_TRUE(found && back) << angle << " " << azimuth;
      worst_px = std::max(worst_px, (*found - px).norm());
      worst_angle = std::max(worst_angle, std::atan2(back->cross(d).norm(), back->dot(d)));
      ++count;
    }
  }
  EXPECT_GT(count, 3000);
  EXPECT_LT(worst_px, 0.02);
  EXPECT_LT(worst_angle, 0.02 / 330);
}

// ---- several cameras ----

const std::string k_stereo = k_head +
                             "M1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 700., 0., "
                             "640., 0., 705., 478., 0., 0., 1. ]\n"
                             "D1: [ -0.25, 0.08, 0.001, -0.0007, -0.01 ]\n"
                             "M2: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 800., 0., "
                             "640., 0., 805., 478., 0., 0., 1. ]\n"
                             "D2: [ 0.1, 0., 0., 0., 0. ]\n";

TEST(CameraFiles, AStereoFilesCamerasAreChosenByName) {
  EXPECT_NE(message_of("stereo.yml", k_stereo).find("found 2: M1, M2. Name one of them: stereo.yml:M1"),
            std::string::npos);
  for (const char* name : {"M1", "left", "1", "D1", "Left"}) {
    const auto left = loaded("stereo.yml", k_stereo, name);
    ASSERT_TRUE(left) << left.message();
    expect_pixels(*left, k_radial, false, 1e-6);
  }
  const auto right = loaded("stereo.yml", k_stereo, "right");
  ASSERT_TRUE(right) << right.message();
  EXPECT_EQ(right->lens.values, (std::vector<double>{800, 805, 640, 478, 0.1, 0, 0, 0, 0}));
  EXPECT_NE(message_of("stereo.yml", k_stereo, "middle").find("'middle'"), std::string::npos);
}

TEST(CameraFiles, OneOfSeveralResolutionsIsChosenBySize) {
  const auto entry = [](int width, int height, double focal) {
    return fmt::format(
        R"({{"resolution": {{"width": {}.0, "height": {}.0}}, "cameraIntrinsics": {{"rows": 3, "cols": 3, "type": 6, "data": [{}, 0, 320, 0, {}, 240, 0, 0, 1]}}, "distCoeffs": {{"rows": 1, "cols": 5, "type": 6, "data": [0.1, 0, 0, 0, 0]}}}})",
        width, height, focal, focal);
  };
  const std::string text = "{\"calibrations\": [" + entry(640, 480, 500) + ", " + entry(960, 720, 750) +
                           "], \"nickname\": \"front\"}";
  const auto large = loaded("config.json", text, "960x720");
  ASSERT_TRUE(large) << large.message();
  EXPECT_EQ(large->lens.fx(), 750);
  EXPECT_NE(message_of("config.json", text).find("calibrations.0 (640x480), calibrations.1 (960x720)"),
            std::string::npos);
}

TEST(CameraFiles, ACamchainHasItsCamerasAndTheirPoses) {
  const std::string chain =
      "cam0:\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [0.1, 0, 0, 0]\n" +
      k_pinhole_list +
      "cam1:\n  T_cn_cnm1:\n  - [0.0, 0.0, 1.0, -0.11]\n  - [0.0, 1.0, 0.0, 0.02]\n  - [-1.0, 0.0, 0.0, "
      "0.03]\n  "
      "- [0.0, 0.0, 0.0, 1.0]\n  cam_overlaps: [0]\n  camera_model: pinhole\n  distortion_model: none\n"
      "  distortion_coeffs: []\n  rostopic: /cam1\n" +
      k_pinhole_list;
  const auto cam1 = loaded("camchain.yaml", chain, "cam1");
  ASSERT_TRUE(cam1) << cam1.message();
  EXPECT_EQ(cam1->name, "cam1");
  EXPECT_EQ(cam1->lens.model.name(), "LENSMODEL_PINHOLE");
  EXPECT_TRUE(test::near(cam1->imager_from_world * Vector3d(1, 2, 3), Vector3d(2.89, 2.02, -0.97), 1e-9));
  const auto cam0 = loaded("camchain.yaml", chain, "cam0");
  ASSERT_TRUE(cam0) << cam0.message();
  EXPECT_EQ(cam0->lens.model.name(), "LENSMODEL_OPENCV4");
}

// ---- what is refused ----

struct RefusedCamera {
  const char* name;
  std::string text;
  const char* part;  // a part that the message contains
};
std::ostream& operator<<(std::ostream& out, const RefusedCamera& file) { return out << file.name; }

struct RefusedCameraFile : testing::TestWithParam<RefusedCamera> {};

TEST_P(RefusedCameraFile, NamesTheEntryOrTheFormat) {
  const std::string message = message_of(std::string(GetParam().name) + ".txt", GetParam().text);
  EXPECT_NE(message.find(GetParam().part), std::string::npos) << message;
  EXPECT_NE(message.find(std::string(GetParam().name) + ".txt"), std::string::npos) << message;
}

std::string with_matrix(const std::string& numbers) {
  return k_size + "camera_matrix: [" + numbers + "]\ndistortion_coefficients: [" + k_five + "]\n";
}
std::string with_entry(const std::string& entry) {
  return k_size + "camera_matrix: " + k_lists + "\n" + entry;
}

INSTANTIATE_TEST_SUITE_P(
    Entries,
    RefusedCameraFile,
    testing::Values(
        RefusedCamera{"misspelled", with_entry("distortion_coefficents: [ " + k_five + " ]\n"),
                      "distortion_coefficents"},
        RefusedCamera{"no_distortion", with_entry(""), "camera_matrix: expected distortion coefficients"},
        RefusedCamera{"null_distortion", with_entry("distortion_coefficients:\n"),
                      "distortion_coefficients: expected numbers"},
        RefusedCamera{"tilted", with_entry("D: [" + k_five + ", 0, 0, 0, 0, 0, 0, 0, 0.02, 0.01]\n"),
                      "CALIB_TILTED_MODEL"},
        RefusedCamera{"two_coefficients", with_entry("distortion_coefficients: [-0.25, 0.08]\n"), "found 2"},
        RefusedCamera{"two_lists", with_entry("distortion_coefficients: [0.1, 0, 0, 0]\nD: [0.2, 0, 0, 0]\n"),
                      "expected one list of coefficients"},
        RefusedCamera{"radial_apart",
                      with_entry("radial_distortion: [0.1, 0.2]\ntangential_distortion: [0, 0]\n"),
                      "radial_distortion"},
        RefusedCamera{"unknown_beside", with_entry("D: [0.1, 0, 0, 0]\ndistortion_center: [1, 2]\n"),
                      "distortion_center"},
        RefusedCamera{"unknown_model", with_entry("distortion_model: fancy\nD: [0.1, 0, 0, 0]\n"),
                      "distortion_model: expected"},
        RefusedCamera{"double_sphere",
                      "cam0:\n  camera_model: ds\n  intrinsics: [-0.2, 0.6, 700, 705, 640, 478]\n  "
                      "distortion_model: none\n"
                      "  distortion_coeffs: []\n  resolution: [1280, 960]\n",
                      "cam0.camera_model"},
        RefusedCamera{"omni",
                      "cam0:\n  camera_model: omni\n  intrinsics: [1.2, 700, 705, 640, 478]\n  "
                      "distortion_model: radtan\n"
                      "  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [1280, 960]\n",
                      "cam0.camera_model"},
        RefusedCamera{"no_model_but_values", with_entry("distortion_model: ''\nD: [0.1, 0, 0, 0]\n"),
                      "distortion_model"},
        RefusedCamera{"fisheye_of_five",
                      with_entry("distortion_model: equidistant\nD: [0.1, 0, 0, 0, 0.1]\n"), "found 5"},
        RefusedCamera{"transposed", with_matrix("700, 0, 0, 0, 705, 0, 640, 478, 1"), "transpose"},
        RefusedCamera{"normalised", with_matrix("0.55, 0, 0.5, 0, 0.73, 0.5, 0, 0, 1"), "normalised"},
        RefusedCamera{"skewed", with_matrix("700, 3, 640, 0, 705, 478, 0, 0, 1"), "skew"},
        RefusedCamera{"offset_from_centre", with_matrix("700, 0, 3.1, 0, 705, -2, 0, 0, 1"), "top-left"},
        RefusedCamera{"far_centre", with_matrix("700, 0, 5000, 0, 705, 478, 0, 0, 1"), "principal point"},
        RefusedCamera{"huge", with_matrix("1e20, 0, 640, 0, 1e20, 478, 0, 0, 1"),
                      "camera_matrix: expected focal lengths"},
        RefusedCamera{"not_finite", with_matrix(".nan, 0, 640, 0, 705, 478, 0, 0, 1"),
                      "camera_matrix: expected finite"},
        RefusedCamera{"uncalibrated", with_matrix("0, 0, 0, 0, 0, 0, 0, 0, 0"), "calibrated"},
        RefusedCamera{"projection",
                      k_size + "K: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]\nD: [0, 0, 0, 0]\n", "3 x 4"},
        RefusedCamera{
            "huge_size",
            "image_width: 12800000000000000000\nimage_height: 960\nK: " + k_lists + "\nD: [0, 0, 0, 0]\n",
            "image_width: expected a whole number"},
        RefusedCamera{
            "binned",
            k_ros_message.substr(0, k_ros_message.find("binning_x")) + "binning_x: 2\nbinning_y: 2\n",
            "binning_x"},
        RefusedCamera{
            "cut",
            k_ros_message.substr(0, k_ros_message.find("roi")) + "roi:\n  x_offset: 16\n  y_offset: 0\n",
            "roi.x_offset"}),
    [](const auto& file) { return std::string(file.param.name); });

INSTANTIATE_TEST_SUITE_P(
    Formats,
    RefusedCameraFile,
    testing::Values(
        RefusedCamera{"npz", std::string("PK\x03\x04\x14\0", 6), "numpy archive"},
        RefusedCamera{"npy", "\x93NUMPY\x01", "numpy array"},
        RefusedCamera{"pickle", "\x80\x04\x95", "Python pickle"},
        RefusedCamera{"mat", "MATLAB 5.0 MAT-file", "MATLAB file"},
        RefusedCamera{"colmap", "# Camera list\n1 OPENCV 1280 960 700 705 640 478 0 0 0 0\n", "COLMAP"},
        RefusedCamera{"metashape",
                      "<?xml version=\"1.0\"?>\n<calibration>\n  <projection>frame</projection>\n  "
                      "<width>1280</width>\n"
                      "  <f>700</f>\n</calibration>\n",
                      "Metashape"},
        RefusedCamera{"ost", "# oST version 5.0 parameters\n\n[image]\n\nwidth\n1280\n",
                      "camera_calibration_parsers"},
        RefusedCamera{"pyyaml_numpy",
                      "K: !!python/object/apply:numpy.core.multiarray._reconstruct\n  args: []\n",
                      ".tolist()"},
        RefusedCamera{"toml", "[cam_0]\nname = \"a\"\nmatrix = [[700.0, 0.0, 640.0]]\n", "INI or TOML"},
        RefusedCamera{"toolbox", "fc = [ 700 ; 705 ];\ncc = [ 640 ; 478 ];\n", "Caltech"},
        RefusedCamera{"nerf", "{\"fl_x\": 700, \"fl_y\": 705, \"cx\": 640, \"cy\": 478, \"k1\": 0.1}",
                      "nerfstudio"},
        RefusedCamera{"stereo_pose", k_head + "R: [ 1, 0, 0, 0, 1, 0, 0, 0, 1 ]\nT: [ 1, 0, 0 ]\n",
                      "found the entries R, T"}),
    [](const auto& file) { return std::string(file.param.name); });

// ---- binary and other texts ----

std::string big_endian_doubles(const std::vector<double>& numbers) {
  std::string bytes;
  for (const double number : numbers)
    for (int shift = 56; shift >= 0; shift -= 8)
      bytes += static_cast<char>(std::bit_cast<std::uint64_t>(number) >> shift & 0xff);
  return bytes;
}

TEST(CameraFiles, ArtoolkitVersion5IsOpencvsLens) {
  std::vector<double> numbers = {700, 0, 640, 0, 0, 705, 478, 0, 0, 0, 1, 0};
  numbers.insert(numbers.end(), k_radial.begin(), k_radial.end());
  numbers.insert(numbers.end(), {0, 0, 0, 0, 0, 0, 0, 1.02 * 700, 1.02 * 705, 640, 478, 1.02});
  const std::string bytes = std::string("\0\0\x05\0\0\0\x03\xc0", 8) + big_endian_doubles(numbers);
  const auto imager = loaded("camera_para.dat", bytes);
  ASSERT_TRUE(imager) << imager.message();
  EXPECT_EQ(imager->lens.values, (std::vector<double>{714, 1.02 * 705, 640, 478, -0.25, 0.08, 0.001, -0.0007,
                                                      -0.01, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(imager->height, 960);
}

TEST(CameraFiles, ACahvorFileIsItsCameraWithItsPose) {
  // The camera looks along the world's x axis; its image's right is the world's -y. The optical axis is the
  // camera's.
  const auto imager = loaded(
      "rover.cahvor",
      "# a comment\nDimensions = 1280 960\nModel = CAHVOR = perspective, distortion\nC = 1.0 2.0 3.0\n"
      "A = 1.0 0.0 0.0\nH = 640.0 -700.0 0.0\nV = 478.0 0.0 -705.0\nO = 1.0 0.0 0.0\nR = 0.0 0.1 -0.02\n");
  ASSERT_TRUE(imager) << imager.message();
  EXPECT_EQ(imager->lens.model.name(), "LENSMODEL_CAHVOR");
  // CAHVOR moves a point by (r0 + r1 t + r2 t^2) times its offset from the axis, t = (offset / depth)^2.
  const double x = 0.3, y = -0.2, t = x * x + y * y, factor = 1 + 0.1 * t - 0.02 * t * t;
  const auto px = imager->project(Vector3d(1, 2, 3) + 2 * Vector3d(1, -x, -y));
  ASSERT_TRUE(px);
  EXPECT_TRUE(test::near(*px, Vector2d(640 + 700 * factor * x, 478 + 705 * factor * y), 1e-9));
}

TEST(CameraFiles, MrcalsOlderFilesAreRead) {
  const auto imager = loaded(
      "old.cameramodel",
      "{\n 'distortion_model': 'DISTORTION_OPENCV4',\n 'intrinsics': [700, 705, 640, 478, 0.1, 0, 0, 0],\n"
      " 'extrinsics': [0, 0, 0, 0, 0, 0],\n 'imagersize': [1280, 960]\n}\n");
  ASSERT_TRUE(imager) << imager.message();
  EXPECT_EQ(imager->lens.model.name(), "LENSMODEL_OPENCV4");
  EXPECT_NE(message_of("huge.cameramodel",
                       "{ 'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1e20, 1e20, 640, 478], "
                       "'extrinsics': [0, 0, 0, 0, 0, 0], 'imagersize': [1280, 960] }")
                .find("values[0]"),
            std::string::npos);
}

}  // namespace
}  // namespace limn
