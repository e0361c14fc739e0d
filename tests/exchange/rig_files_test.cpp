// Rigs that other programs calibrated: a world point has the pixels that the other program's formulas give.
#include "exchange/rig_files.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/calib3d.hpp>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/support/run_limn.h"

namespace limn::exchange {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using test::near;
namespace fs = std::filesystem;

const std::string k_k1 = "1400. 0. 640. 0. 1410. 500. 0. 0. 1.";
const std::string k_d1 = "-0.2 0.1 0.001 -0.002 0.03";
const std::string k_k2 = "1900. 0. 500. 0. 1905. 700. 0. 0. 1.";
const std::string k_d2 = "-0.05 0.02 0.0005 0.001 0.";
// A turn by 30 degrees about y and a translation of 250 mm.
const std::string k_r = "0.86602540378443865 0. 0.5 0. 1. 0. -0.5 0. 0.86602540378443865";
const std::string k_t = "-150. 0. 200.";

std::string xml_matrix(const std::string& name, int rows, int columns, const std::string& data) {
  return fmt::format(
      "<{0} type_id=\"opencv-matrix\"><rows>{1}</rows><cols>{2}</cols><dt>d</dt><data>\n{3}</data></{0}>\n",
      name, rows, columns, data);
}

std::string yaml_matrix(const std::string& name, int rows, int columns, std::string data) {
  std::replace(data.begin(), data.end(), ' ', ',');
  return fmt::format("{}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [ {} ]\n", name, rows,
                     columns, data);
}

std::string in_storage(const std::string& entries) {
  return "<?xml version=\"1.0\"?>\n<opencv_storage>\n" + entries + "</opencv_storage>\n";
}

const std::string k_head = "%YAML:1.0\n---\n";

std::string kamino_file(const std::string& rotation_name = "rotation") {
  return in_storage(xml_matrix("img_shape", 2, 1, "1024. 1280.") + "<rms>0.4</rms>" +
                    xml_matrix("cam_int", 3, 3, k_k1) + xml_matrix("cam_dist", 1, 5, k_d1) +
                    xml_matrix("proj_int", 3, 3, k_k2) + xml_matrix("proj_dist", 1, 5, k_d2) +
                    xml_matrix(rotation_name, 3, 3, k_r) + xml_matrix("translation", 3, 1, k_t));
}

std::string slstudio_file() {
  return in_storage(xml_matrix("Kc", 3, 3, k_k1) + xml_matrix("kc", 5, 1, k_d1) +
                    xml_matrix("Kp", 3, 3, k_k2) + xml_matrix("kp", 5, 1, k_d2) +
                    xml_matrix("Rp", 3, 3, k_r) + xml_matrix("Tp", 3, 1, k_t) +
                    "<cam_error>0.3</cam_error><frameWidth>1280</frameWidth><frameHeight>1024</frameHeight>"
                    "<screenResX>1024</screenResX><screenResY>768</screenResY>");
}

std::string procamcalib_file(const std::string& rotation = k_r) {
  return k_head + yaml_matrix("cam_K", 3, 3, k_k1) + yaml_matrix("cam_kc", 1, 5, k_d1) +
         yaml_matrix("proj_K", 3, 3, k_k2) + yaml_matrix("proj_kc", 1, 5, k_d2) +
         yaml_matrix("R", 3, 3, rotation) + yaml_matrix("T", 3, 1, k_t) + "cam_error: 0.2\n";
}

std::string stereo_intrinsics() {
  return yaml_matrix("M1", 3, 3, k_k1) + yaml_matrix("D1", 1, 5, k_d1) + yaml_matrix("M2", 3, 3, k_k2) +
         yaml_matrix("D2", 1, 5, k_d2);
}

std::string stereo_extrinsics() {
  return yaml_matrix("R", 3, 3, k_r) + yaml_matrix("T", 3, 1, k_t) +
         yaml_matrix("R1", 3, 3, "1 0 0 0 1 0 0 0 1");
}

fs::path stored(const std::string& name, const std::string& text) {
  const fs::path path = test::test_folder() / name;
  EXPECT_TRUE(write_file(path, text));
  return path;
}

RigFileOptions in_mm() {
  RigFileOptions options;
  options.units = scene::LengthUnit::millimetre;
  return options;
}

RigFileOptions with_sizes() {
  RigFileOptions options = in_mm();
  options.camera_size = {1280, 1024};
  options.projector_size = {1024, 768};
  return options;
}

Vector2d opencv_pixel(const Vector3d& p, const cv::Matx33d& matrix, const std::vector<double>& distortion) {
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(std::vector<cv::Point3d>{{p.x(), p.y(), p.z()}}, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0),
                    matrix, distortion, pixels);
  return {pixels[0].x, pixels[0].y};
}

// The pixels of a point (m, in the first device) in both devices of the files above: p2 = R p1 + T.
void expect_pair(const Imager& first, const Imager& second) {
  const Matrix3d turned = Eigen::AngleAxisd(std::numbers::pi / 6, Vector3d::UnitY()).toRotationMatrix();
  for (const Vector3d& p : {Vector3d(0.05, -0.1, 1.2), Vector3d(-0.3, 0.2, 1.5)}) {
    const auto a = first.project(p), b = second.project(p);
    ASSERT_TRUE(a && b);
    EXPECT_TRUE(near(
        *a, opencv_pixel(p, {1400, 0, 640, 0, 1410, 500, 0, 0, 1}, {-0.2, 0.1, 0.001, -0.002, 0.03}), 1e-6));
    EXPECT_TRUE(near(*b,
                     opencv_pixel(turned * p + Vector3d(-0.15, 0, 0.2), {1900, 0, 500, 0, 1905, 700, 0, 0, 1},
                                  {-0.05, 0.02, 0.0005, 0.001, 0}),
                     1e-6));
  }
  EXPECT_EQ(first.width, 1280);
  EXPECT_EQ(first.height, 1024);
  EXPECT_EQ(first.name, "camera0");
}

void expect_projector(const Result<RigFile>& file, const std::string& program) {
  ASSERT_TRUE(file) << file.message();
  EXPECT_EQ(file->program, program);
  ASSERT_EQ(file->rig.cameras.size(), 1u);
  ASSERT_EQ(file->rig.projectors.size(), 1u);
  expect_pair(file->rig.cameras[0], file->rig.projectors[0]);
  EXPECT_EQ(file->rig.projectors[0].name, "projector0");
  EXPECT_EQ(file->rig.projectors[0].width, 1024);
  EXPECT_EQ(file->rig.projectors[0].height, 768);
}

TEST(RigFiles, ProcamCalibrationIsReadInBothSpellings) {
  RigFileOptions options = in_mm();
  options.projector_size = {1024, 768};
  for (const char* rotation : {"rotation", "roration"})
    expect_projector(read_rig_files({stored("result.xml", kamino_file(rotation))}, options),
                     "procam-calibration");
}

TEST(RigFiles, SlstudioHasItsSizes) {
  expect_projector(read_rig_files({stored("calibration.xml", slstudio_file())}, in_mm()), "SLStudio");
}

TEST(RigFiles, ProcamcalibNeedsBothSizes) {
  expect_projector(read_rig_files({stored("calibration.yml", procamcalib_file())}, with_sizes()),
                   "procamcalib");
}

TEST(RigFiles, AStereoCalibrationIsTwoCamerasInOneFileOrTwo) {
  RigFileOptions options = in_mm();
  options.camera_size = {1280, 1024};
  const fs::path folder = test::test_folder();
  ASSERT_TRUE(write_file(folder / "intrinsics.yml", k_head + stereo_intrinsics()));
  ASSERT_TRUE(write_file(folder / "extrinsics.yml", k_head + stereo_extrinsics()));
  ASSERT_TRUE(write_file(folder / "stereo.yml", k_head + stereo_intrinsics() + stereo_extrinsics()));
  using Paths = std::vector<fs::path>;
  for (const Paths& files :
       {Paths{folder / "stereo.yml"}, Paths{folder / "intrinsics.yml", folder / "extrinsics.yml"},
        Paths{folder / "extrinsics.yml", folder / "intrinsics.yml"}}) {
    const auto file = read_rig_files(files, options);
    ASSERT_TRUE(file) << file.message();
    ASSERT_EQ(file->rig.cameras.size(), 2u);
    EXPECT_TRUE(file->rig.projectors.empty());
    EXPECT_EQ(file->rig.cameras[1].name, "camera1");
    expect_pair(file->rig.cameras[0], file->rig.cameras[1]);
  }
  EXPECT_NE(read_rig_files({folder / "intrinsics.yml"}, options).message().find("rotation R"),
            std::string::npos);
  EXPECT_NE(read_rig_files({folder / "extrinsics.yml"}, options).message().find("two cameras"),
            std::string::npos);
}

TEST(RigFiles, TheSecondDeviceOfAStereoCalibrationMayBeAProjector) {
  const fs::path path =
      stored("stereo.xml",
             in_storage(xml_matrix("cameraMatrix1", 3, 3, k_k1) + xml_matrix("distCoeffs1", 1, 5, k_d1) +
                        xml_matrix("cameraMatrix2", 3, 3, k_k2) + xml_matrix("distCoeffs2", 1, 5, k_d2) +
                        xml_matrix("R", 3, 3, k_r) + xml_matrix("T", 3, 1, k_t)));
  expect_projector(read_rig_files({path}, with_sizes()), "OpenCV stereo");
}

// ---- RoomAlive ----

// `rows` row by row, written column by column.
std::string by_columns(const std::string& name, const Eigen::MatrixXd& matrix) {
  std::string text = "<" + name + "><ValuesByColumn xmlns:d6p1=\"arrays\">";
  for (Eigen::Index column = 0; column < matrix.cols(); ++column) {
    text += "<d6p1:ArrayOfdouble>";
    for (Eigen::Index row = 0; row < matrix.rows(); ++row)
      text += fmt::format("<d6p1:double>{}</d6p1:double>", matrix(row, column));
    text += "</d6p1:ArrayOfdouble>";
  }
  return text + "</ValuesByColumn></" + name + ">";
}

Matrix3d camera_matrix(double f, double cx, double cy) {
  return (Matrix3d() << f, 0, cx, 0, f, cy, 0, 0, 1).finished();
}

struct RoomAlive {
  Matrix3d colour = camera_matrix(1060, 945, 545), projector = camera_matrix(960, 650, 773);
  Vector2d colour_k{0.016, -0.004}, projector_k{-0.03, 0.01};
  Pose colour_from_depth{Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Vector3d::UnitZ())), {0.052, 0.001, 0}};
  Pose world_from_depth{Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Vector3d::UnitY())), {0.4, 0.1, -0.2}};
  Pose world_from_projector{Eigen::Quaterniond(Eigen::AngleAxisd(-0.35, Vector3d::UnitX())),
                            {0.1, -0.1, 0.05}};

  std::string xml() const {
    return "<?xml version=\"1.0\"?><ProjectorCameraEnsemble "
           "xmlns=\"x\"><cameras><ProjectorCameraEnsemble.Camera>"
           "<calibration>" +
           by_columns("colorCameraMatrix", colour) + by_columns("colorLensDistortion", colour_k) +
           by_columns("depthToColorTransform", colour_from_depth.matrix()) + "</calibration><name>0</name>" +
           by_columns("pose", world_from_depth.matrix()) +
           "</ProjectorCameraEnsemble.Camera></cameras><name>Untitled</name><projectors>"
           "<ProjectorCameraEnsemble.Projector>" +
           by_columns("cameraMatrix", projector) + "<height>720</height>" +
           by_columns("lensDistortion", projector_k) + by_columns("pose", world_from_projector.matrix()) +
           "<width>1280</width></ProjectorCameraEnsemble.Projector></projectors></ProjectorCameraEnsemble>";
  }
  // RoomAlive's image point: x to the left, y up.
  static Vector2d image_point(const Vector3d& p, const Matrix3d& matrix, const Vector2d& k) {
    const Vector2d flat = p.head<2>() / p.z();
    const double r2 = flat.squaredNorm();
    return matrix(0, 0) * (1 + k[0] * r2 + k[1] * r2 * r2) * flat + Vector2d(matrix(0, 2), matrix(1, 2));
  }
};

TEST(RigFiles, RoomalivesAxesAndPixelsAreTurned) {
  const RoomAlive ensemble;
  const auto file = read_rig_files({stored("room.xml", ensemble.xml())}, {});
  ASSERT_TRUE(file) << file.message();
  ASSERT_EQ(file->rig.cameras.size(), 1u);
  ASSERT_EQ(file->rig.projectors.size(), 1u);
  const Imager &camera = file->rig.cameras[0], &projector = file->rig.projectors[0];
  EXPECT_EQ(camera.width, 1920);
  EXPECT_EQ(projector.height, 720);
  for (const Vector3d& p_depth : {Vector3d(0.1, 0.2, 2), Vector3d(-0.4, -0.3, 1.5)}) {
    const Vector3d p_colour = ensemble.colour_from_depth * p_depth;
    // Limn's world is the colour camera's frame with x to the right and y down.
    const Vector3d p(-p_colour.x(), -p_colour.y(), p_colour.z());
    const Vector2d uv = RoomAlive::image_point(p_colour, ensemble.colour, ensemble.colour_k);
    // The file's column u belongs to the mirrored image; the row is height - v.
    EXPECT_TRUE(near(camera.project(p).value(), Vector2d(1919 - uv.x(), 1080 - uv.y()), 1e-6));
    const Vector3d p_projector =
        ensemble.world_from_projector.inverse() * (ensemble.world_from_depth * p_depth);
    const Vector2d point = RoomAlive::image_point(p_projector, ensemble.projector, ensemble.projector_k);
    EXPECT_TRUE(near(projector.project(p).value(), Vector2d(1280 - point.x(), 720 - point.y()), 1e-6));
  }
  EXPECT_NE(file->remarks.back().find("mirrored"), std::string::npos);
  EXPECT_TRUE(read_rig_files({stored("room.xml", ensemble.xml())}, in_mm()).error().wrong_usage);
}

TEST(RigFiles, ARoomaliveFileThatWasNotCalibratedIsRefused) {
  std::string xml = RoomAlive().xml();
  const auto begin = xml.rfind("<pose>"), end = xml.rfind("</pose>");
  xml.replace(begin, end + 7 - begin, "<pose i:nil=\"true\" />");
  const auto file = read_rig_files({stored("room.xml", xml)}, {});
  ASSERT_FALSE(file);
  EXPECT_NE(file.message().find("projectors.0.pose"), std::string::npos) << file.message();
}

// ---- MPCDI ----

std::string mpcdi_xml(const std::string& profile, const std::string& fileset) {
  return "<?xml version=\"1.0\"?><MPCDI profile=\"" + profile +
         R"(" version="2.0"><display><buffer id="b"><region id="P1" xResolution="1400" yResolution="1050" x="0" y="0"
xsize="1" ysize="1"><frustum><yaw>0</yaw><pitch>0</pitch><roll>0</roll><rightAngle>45</rightAngle>
<leftAngle>-45</leftAngle><upAngle>30</upAngle><downAngle>-30</downAngle></frustum><coordinateFrame><posx>100</posx>
<posy>0</posy><posz>0</posz><yawx>0</yawx><yawy>0</yawy><yawz>-1</yawz><pitchx>1</pitchx><pitchy>0</pitchy>
<pitchz>0</pitchz><rollx>0</rollx><rolly>1</rolly><rollz>0</rollz></coordinateFrame></region></buffer></display><files>)" +
         fileset + "</files></MPCDI>";
}

TEST(RigFiles, AnMpcdiFileOfPosesAloneIsARig) {
  // The file's maps are not beside its XML.
  const std::string fileset =
      "<fileset region=\"P1\"><geometryWarpFile><geometricUnit>cm</geometricUnit><path>warp.pfm</path>"
      "</geometryWarpFile><alphaMap><path>alpha.png</path></alphaMap></fileset>";
  for (const char* profile : {"sl", "a3"}) {
    const auto file = read_rig_files({stored("head.mpcdi.xml", mpcdi_xml(profile, fileset))}, {});
    ASSERT_TRUE(file) << file.message();
    ASSERT_EQ(file->rig.projectors.size(), 1u);
    const Imager& projector = file->rig.projectors[0];
    EXPECT_EQ(projector.name, "P1");
    // It is 1 m to the right (x), looks along y, and z is up: 45 degrees to the right is the image's border.
    EXPECT_TRUE(near(projector.project({1, 2, 0}).value(), Vector2d(699.5, 524.5), 1e-6));
    EXPECT_TRUE(near(projector.project({3, 2, 0}).value(), Vector2d(1399.5, 524.5), 1e-6));
    EXPECT_LT(projector.project({1, 2, 0.1})->y(), 524);
  }
  const auto plain = read_rig_files({stored("plain.mpcdi.xml", mpcdi_xml("3d", ""))}, {});
  ASSERT_TRUE(plain) << plain.message();
  EXPECT_NE(plain->remarks.at(0).find("metres"), std::string::npos);
}

// ---- what is refused ----

TEST(RigFiles, UnitsAndSizesThatTheFileLacksAreAskedFor) {
  const auto expect_usage = [](const Result<RigFile>& file, const std::string& part) {
    ASSERT_FALSE(file);
    EXPECT_TRUE(file.error().wrong_usage) << file.message();
    EXPECT_NE(file.message().find(part), std::string::npos) << file.message();
  };
  const fs::path path = stored("calibration.yml", procamcalib_file());
  RigFileOptions options = with_sizes();
  options.units.reset();
  expect_usage(read_rig_files({path}, options), "--units mm");
  options = with_sizes();
  options.camera_size.reset();
  expect_usage(read_rig_files({path}, options), "--camera-size");
  options = with_sizes();
  options.projector_size.reset();
  expect_usage(read_rig_files({path}, options), "--projector");
  options = with_sizes();
  options.camera_size = {640, 480};
  expect_usage(read_rig_files({stored("calibration.xml", slstudio_file())}, options), "1280x1024");
}

TEST(RigFiles, UnitsScaleTheDistance) {
  RigFileOptions options = with_sizes();
  options.units = scene::LengthUnit::inch;
  const auto file = read_rig_files({stored("calibration.yml", procamcalib_file())}, options);
  ASSERT_TRUE(file) << file.message();
  EXPECT_NEAR(file->rig.projectors[0].imager_from_world.translation.norm(), 250 * 0.0254, 1e-9);
}

TEST(RigFiles, WhatIsNoRigIsNamed) {
  const auto message_of = [](const std::string& text) {
    const auto file = read_rig_files({stored("file.yml", text)}, with_sizes());
    return file ? std::string("read as " + file->program) : file.message();
  };
  const auto expect_part = [&](const std::string& text, const std::string& part) {
    EXPECT_NE(message_of(text).find(part), std::string::npos) << message_of(text);
  };
  expect_part(procamcalib_file("1 0 0 0 1 0 0 0 -1"), "R: expected a rotation");
  expect_part(procamcalib_file("1 0 0 0 1 0 0 0 1.01"), "R: expected a rotation");
  expect_part(procamcalib_file("1 0 0 0 1 0 0 0"), "R: expected rows x cols");
  expect_part(k_head + yaml_matrix("cam_K", 3, 3, k_k1) + yaml_matrix("proj_K", 3, 3, k_k2),
              "cam_kc: expected");
  std::string infinite = procamcalib_file();
  infinite.replace(infinite.find("-150."), 5, ".Inf");
  expect_part(infinite, "T.data: expected finite");
  std::string far = procamcalib_file();
  far.replace(far.find("-150."), 5, "1e300");
  expect_part(far, "T: expected a translation");
  expect_part("a: 1\nb: 2\n", "found the entries a, b");
}

TEST(RigFiles, TheCommandWritesTheRigAndSaysTheDistance) {
  const fs::path path = stored("result.xml", kamino_file());
  const std::string out = (path.parent_path() / "rig").string();
  const auto without_unit = test::run_limn({"import", "rig", path.string(), "--out", out});
  EXPECT_EQ(without_unit.code, 2) << without_unit.err;
  EXPECT_NE(without_unit.err.find("--units"), std::string::npos);
  std::vector<std::string> command = {"import",  "rig", path.string(), "--out",   out,
                                      "--units", "mm",  "--projector", "1024x768"};
  const auto done = test::run_limn(command);
  EXPECT_EQ(done.code, 0) << done.err;
  EXPECT_NE(done.out.find("camera0: 1280x1024, focal length 1400.0 px\n"), std::string::npos) << done.out;
  EXPECT_NE(done.out.find("projector0: 1024x768, focal length 1900.0 px, 250.0 mm from camera0\n"),
            std::string::npos)
      << done.out;
  const Rig rig = load_rig(out).value();
  expect_pair(rig.cameras.at(0), rig.projectors.at(0));
  command.push_back("--json");
  const auto report = nlohmann::json::parse(test::run_limn(command).out);
  EXPECT_EQ(report["schema"], "limn.import_rig/1");
  EXPECT_NEAR(report["projectors"][0]["distance_mm"].get<double>(), 250, 1e-6);
  EXPECT_EQ(test::run_limn({"import"}).code, 2);
}

}  // namespace
}  // namespace limn::exchange
