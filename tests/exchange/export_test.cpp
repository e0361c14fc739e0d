#include "apps/export.h"

#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputFile.h>

#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <regex>

#include "apps/import.h"
#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/rig.h"
#include "device/gl_context.h"
#include "exchange/mpcdi_reader.h"
#include "exchange/mpcdi_writer.h"
#include "exchange/pfm.h"
#include "exchange/zip.h"
#include "projector/renderer.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "tests/support/matchers.h"

namespace limn::exchange {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using nlohmann::json;
using test::near;
using namespace test::literals;
namespace fs = std::filesystem;

const float k_nan = std::numeric_limits<float>::quiet_NaN();

bool is_same_bits(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && a.isContinuous() && b.isContinuous() &&
         std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

std::vector<std::string> files_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  return names;
}

// The door of config/scenes, turned in the world, in front of two projectors with lens distortion.
class ExportDoor : public testing::Test {
 protected:
  void SetUp() override {
    folder = test::test_folder();
    Imager projector{"projector0", 320, 240, {}, looking_at({-0.3, 0.2, 1.1}, {0, 0, 0}, {0, 1, 0})};
    projector.lens = Lens::create("LENSMODEL_OPENCV4", {360, 355, 150, 130, -0.15, 0.05, 0.001, 0}).value();
    Imager other = projector;
    other.name = "projector1";
    other.imager_from_world = looking_at({0.4, -0.1, 1.0}, {0.1, 0, 0}, {0.2, 1, 0});
    rig.projectors = {projector, other};
    ASSERT_TRUE(save_rig(rig, folder / "rig"));
    ASSERT_TRUE(
        write_file(folder / "poses.json",
                   json{{"world_from_prototype", to_json(world_from_prototype)}, {"slots", slots()}}.dump()));
    options.rig = folder / "rig";
    options.scene = fs::path(LIMN_SOURCE_DIR) / "config/scenes/door";
    options.poses = folder / "poses.json";
    options.mpcdi = folder / "door.mpcdi";
  }
  static json slots() {
    return {
        {"mirror", {{"world_from_part", to_json(Pose(Eigen::Quaterniond::Identity(), {-0.1, 0.1, 0.1}))}}}};
  }
  // The renderer's results for one projector.
  std::pair<cv::Mat, cv::Mat> drawn(std::size_t index) const {
    const auto context = device::GlContext::create().value();
    const scene::Scene scene = scene::load_scene(options.scene).value();
    auto renderer = projector::Renderer::create(scene, rig).value();
    const scene::PosedScene posed{world_from_prototype, {}};
    return {renderer.surface_points(index, posed), renderer.blend(index, posed)};
  }
  Pose world_from_prototype{exp_rotation({0.1, -0.2, 0.3}), {0.02, 0.03, -0.05}};
  Rig rig;
  fs::path folder;
  ExportOptions options;
};

TEST_F(ExportDoor, ComesBackWithItsPointsSharesAndProjectors) {
  const Status status = apps::run_export(options);
  ASSERT_TRUE(status) << status.message();
  const auto mpcdi = read_mpcdi(options.mpcdi);
  ASSERT_TRUE(mpcdi) << mpcdi.message();
  EXPECT_EQ(mpcdi->profile, MpcdiProfile::shader_lamps);
  EXPECT_TRUE(mpcdi->remarks.empty());
  ASSERT_EQ(mpcdi->regions.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    const MpcdiRegion& region = mpcdi->regions[i];
    const auto [points, blend] = drawn(i);
    EXPECT_TRUE(is_same_bits(region.warp, points));
    EXPECT_FALSE(region.beta) << "no black was measured";
    cv::Mat share;
    region.alpha->image.convertTo(share, CV_32F, 1.0 / 65535);
    cv::Mat wanted;
    cv::extractChannel(blend, wanted, 0);
    EXPECT_LT(cv::norm(share, wanted, cv::NORM_INF), 0.51 / 65535);

    const Imager imager = *imager_of(region);
    const Pose projector_from_prototype = rig.projectors[i].imager_from_world * world_from_prototype;
    EXPECT_TRUE(test::pose_near(imager.imager_from_world, projector_from_prototype, 1e-9, 1e-12));
    EXPECT_EQ(imager.lens.values, rig.projectors[i].lens.values);
    // Without Limn's own extension, the pinhole and the distortion map give the same result.
    MpcdiRegion foreign = region;
    foreign.lens.reset();
    const Imager pinhole = *imager_of(foreign);
    int lit = 0;
    for (int row = 0; row < region.height; ++row) {
      for (int column = 0; column < region.width; ++column) {
        const auto& p = region.warp.at<cv::Vec3f>(row, column);
        if (std::isnan(p[0])) continue;
        ++lit;
        const auto& place = region.distortion.at<cv::Vec3f>(row, column);
        const Vector2d px = *pinhole.project(Vector3d(p[0], p[1], p[2]));
        const Vector2d by_map(place[0] * static_cast<float>(region.width) - 0.5f,
                              place[1] * static_cast<float>(region.height) - 0.5f);
        ASSERT_TRUE(near(px, by_map, 0.02)) << column << " " << row;
        ASSERT_TRUE(near(*imager.project(Vector3d(p[0], p[1], p[2])), Vector2d(column, row), 0.02));
      }
    }
    EXPECT_GT(lit, 5000);
  }
  apps::ImportOptions import{options.mpcdi, folder / "back"};
  ASSERT_TRUE(apps::run_import(import));
  EXPECT_EQ(load_rig(folder / "back")->projectors.size(), 2u);
}

TEST_F(ExportDoor, GivesPlacesInTheViewersImage) {
  options.profile = MpcdiProfile::from_viewer;
  options.bits = 8;
  options.gamma = 2.2;
  const Pose world_from_viewer = looking_at({0.2, 0.1, 1.3}, {0, 0, 0}, {0, 1, 0}).inverse();
  options.viewer = folder / "viewer.json";
  ASSERT_TRUE(write_file(
      options.viewer,
      json{{"world_from_viewer", to_json(world_from_viewer)}, {"size", {400, 200}}, {"fov_deg", 20}}.dump()));
  const Status status = apps::run_export(options);
  ASSERT_TRUE(status) << status.message();
  const Mpcdi mpcdi = read_mpcdi(options.mpcdi).value();
  const MpcdiRegion& region = mpcdi.regions[1];
  EXPECT_NEAR(region.frustum->right, 10, 1e-9);
  EXPECT_NEAR(region.frustum->left, -10, 1e-9);
  EXPECT_NEAR(std::tan(region.frustum->up * 1_deg), std::tan(10_deg) / 2, 1e-9);
  EXPECT_NEAR(region.frustum->yaw, 0, 1e-9);
  const auto [points, blend] = drawn(1);
  const Imager viewer = viewer_imager(world_from_viewer, 400, 200, 20);
  int inside = 0, outside = 0;
  for (int row = 0; row < region.height; ++row) {
    for (int column = 0; column < region.width; ++column) {
      const auto& p = points.at<cv::Vec3f>(row, column);
      const auto& place = region.warp.at<cv::Vec3f>(row, column);
      if (!std::isnan(p[0]) && std::isnan(place[0])) ++outside;
      if (std::isnan(place[0])) continue;
      ++inside;
      const Vector2d px = *viewer.project(world_from_prototype * Vector3d(p[0], p[1], p[2]));
      ASSERT_TRUE(near(Vector2d(place[0] * 400 - 0.5, place[1] * 200 - 0.5), px, 1e-3));
    }
  }
  EXPECT_GT(inside, 3000);
  EXPECT_GT(outside, 1000);
  // Alpha: 8 bits, encoded.
  const auto [row, column] = std::array{120, 160};
  const float share = blend.at<cv::Vec2f>(row, column)[0];
  ASSERT_GT(share, 0.1);
  EXPECT_EQ(region.alpha->gamma_embedded, 2.2);
  EXPECT_NEAR(region.alpha->image.at<std::uint8_t>(row, column), 255 * std::pow(share, 1 / 2.2), 0.51);
}

TEST_F(ExportDoor, WritesWarpsAsPfmAndExr) {
  options.mpcdi.clear();
  for (const WarpFormat format : {WarpFormat::pfm, WarpFormat::exr}) {
    options.format = format;
    options.warp = folder / "warps";
    ASSERT_TRUE(apps::run_export(options));
  }
  EXPECT_EQ(files_in(options.warp), (std::vector<std::string>{"warp-projector0.exr", "warp-projector0.pfm",
                                                              "warp-projector1.exr", "warp-projector1.pfm"}));
  const cv::Mat points = drawn(1).first;
  const std::string bytes = read_file(options.warp / "warp-projector1.pfm").value();
  EXPECT_TRUE(bytes.starts_with("PF\n320 240\n-1"));
  EXPECT_TRUE(is_same_bits(read_pfm(bytes, "warp", 1 << 20).value(), points));
  // The last row of the file is the top row of the image.
  EXPECT_EQ(bytes.substr(bytes.size() - 320 * 12), std::string(points.ptr<char>(0), 320 * 12));

  Imf::InputFile exr((options.warp / "warp-projector1.exr").c_str());
  cv::Mat image(points.size(), CV_32FC3);
  Imf::FrameBuffer channels;
  for (int c = 0; c < 3; ++c) {
    channels.insert(std::string(1, "RGB"[c]),
                    Imf::Slice(Imf::FLOAT, image.ptr<char>() + 4 * c, 12, image.step[0]));
  }
  exr.setFrameBuffer(channels);
  exr.readPixels(0, 239);
  EXPECT_TRUE(is_same_bits(image, points));
}

TEST_F(ExportDoor, WritesEachLookAsTheViewerSeesIt) {
  options.mpcdi.clear();
  options.looks = folder / "looks";
  const Status status = apps::run_export(options);
  ASSERT_TRUE(status) << status.message();
  const scene::Scene scene = scene::load_scene(options.scene).value();
  const auto& variants = scene.find_slot("mirror")->variants;
  ASSERT_EQ(files_in(options.looks).size(), variants.size());
  std::vector<cv::Mat> looks;
  for (const scene::Variant& variant : variants) {
    looks.push_back(read_image(options.looks / ("look-mirror-" + variant.name + ".png")).value());
    EXPECT_EQ(looks.back().size(), cv::Size(1280, 800));
    EXPECT_GT(cv::countNonZero(looks.back().reshape(1)), 1000) << variant.name;
    if (looks.size() > 1) {
      EXPECT_GT(cv::norm(looks[0], looks.back(), cv::NORM_INF), 20) << variant.name;
    }
  }
}

TEST_F(ExportDoor, LeavesNothingBehindWhereItCannotWrite) {
  ASSERT_TRUE(make_folder(folder / "there"));
  ASSERT_TRUE(make_folder(folder / "there" / "door.mpcdi"));  // a folder of the file's name
  options.mpcdi = folder / "there" / "door.mpcdi";
  Status status = apps::run_export(options);
  ASSERT_FALSE(status);
  EXPECT_NE(status.message().find("door.mpcdi"), std::string::npos) << status.message();
  EXPECT_FALSE(status.error().wrong_usage);
  EXPECT_EQ(files_in(folder / "there"), std::vector<std::string>{"door.mpcdi"});
  EXPECT_TRUE(files_in(options.mpcdi).empty());
  options.mpcdi = folder / "nowhere" / "door.mpcdi";
  EXPECT_FALSE(apps::run_export(options));
  EXPECT_FALSE(fs::exists(folder / "nowhere"));
}

TEST_F(ExportDoor, MistakesAreErrors) {
  const auto failed = [](const ExportOptions& wrong, bool usage, const std::string& says) {
    const Status status = apps::run_export(wrong);
    ASSERT_FALSE(status) << says;
    EXPECT_NE(status.message().find(says), std::string::npos) << status.message();
    EXPECT_EQ(status.error().wrong_usage, usage) << status.message();
    EXPECT_FALSE(fs::exists(wrong.mpcdi));
  };
  ExportOptions wrong = options;
  wrong.mpcdi.clear();
  failed(wrong, true, "--mpcdi");
  wrong = options;
  wrong.profile = MpcdiProfile::flat;
  failed(wrong, true, "--profile");
  wrong = options;
  wrong.bits = 12;
  failed(wrong, true, "--bits");
  wrong = options;
  wrong.gamma = 0;
  failed(wrong, true, "--gamma");
  wrong = options;
  ASSERT_TRUE(write_file(folder / "bare.json",
                         json{{"world_from_prototype", to_json(Pose())}, {"slots", json::object()}}.dump()));
  wrong.poses = folder / "bare.json";
  wrong.looks = folder / "looks";
  failed(wrong, false, "--looks");
  wrong = options;
  ASSERT_TRUE(write_file(folder / "nothing.json", json{{"slots", json::object()}}.dump()));
  wrong.poses = folder / "nothing.json";
  failed(wrong, false, "world_from_prototype");
  ASSERT_TRUE(
      write_file(folder / "away.json",
                 json{{"world_from_prototype", to_json(Pose(Eigen::Quaterniond::Identity(), {0, 0, 9}))},
                      {"slots", json::object()}}
                     .dump()));
  wrong.poses = folder / "away.json";
  failed(wrong, false, "away.json");
  Rig blind = rig;
  blind.projectors.clear();
  blind.cameras = {rig.projectors[0]};
  blind.cameras[0].name = "camera0";
  ASSERT_TRUE(save_rig(blind, folder / "blind"));
  wrong = options;
  wrong.rig = folder / "blind";
  failed(wrong, false, "projectors");
}

// Two pinholes side by side in front of a sheet: a point's pixel in one is 160 pixels beside that in the
// other.
TEST(ExportSheet, SharesSumToOneAndBetaEvensBlack) {
  const fs::path folder = test::test_folder();
  ASSERT_TRUE(make_folder(folder / "scene"));
  ASSERT_TRUE(write_file(folder / "scene/sheet.obj",
                         "v -0.5 -0.3 0\nv 0.5 -0.3 0\nv 0.5 0.3 0\nv -0.5 0.3 0\nf 1 2 3\nf 1 3 4\n"));
  const json scene = {
      {"schema", "limn.scene/1"},
      {"prototype", {{"mesh", "sheet.obj"}, {"units", "m"}, {"albedo", 0.8}, {"markers", json::array()}}},
      {"slots", json::array()}};
  ASSERT_TRUE(write_file(folder / "scene/scene.json", scene.dump()));
  ASSERT_TRUE(write_file(folder / "poses.json",
                         json{{"world_from_prototype", to_json(Pose())}, {"slots", json::object()}}.dump()));
  const double black[2] = {0.004, 0.01};
  const Vector3d p_eye[2] = {{-0.2, 0, -1}, {0.2, 0, -1}};
  Rig rig;
  RigResponses responses;
  for (std::size_t i = 0; i < 2; ++i) {
    rig.projectors.push_back({fmt::format("projector{}", i), 320, 200, Lens::pinhole(400, 400, 160, 100),
                              Pose(Eigen::Quaterniond::Identity(), -p_eye[i])});
    ProjectorResponse response{rig.projectors[i].name, {}, {}, {}};
    for (auto* curve : {&response.red, &response.green, &response.blue})
      for (int k = 0; k <= 64; ++k) curve->push_back(black[i] + (1 - black[i]) * std::pow(k / 64.0, 2));
    response.black_level = Measurement{black[i], 0};
    responses.projectors.push_back(response);
  }
  ASSERT_TRUE(save_rig(rig, folder / "rig"));
  ASSERT_TRUE(save_responses(responses, {}, folder / "rig"));
  ExportOptions options;
  options.rig = folder / "rig";
  options.scene = folder / "scene";
  options.poses = folder / "poses.json";
  options.mpcdi = folder / "sheet.mpcdi";
  const Status status = apps::run_export(options);
  ASSERT_TRUE(status) << status.message();
  const Mpcdi mpcdi = read_mpcdi(options.mpcdi).value();
  EXPECT_EQ(mpcdi.colour_level, 2);
  const MpcdiRegion& left = mpcdi.regions[0];
  const MpcdiRegion& right = mpcdi.regions[1];
  const auto irradiance = [&](std::size_t i, const Vector3d& p) {
    return 1 / std::pow((p_eye[i] - p).norm(), 3);
  };
  int both = 0, alone = 0;
  double worst = 0, worst_light = 0;
  for (int row = 0; row < 200; ++row) {
    for (int column = 0; column < 320; ++column) {
      const auto& q = left.warp.at<cv::Vec3f>(row, column);
      const int share = left.alpha->image.at<cv::Vec3w>(row, column)[1];
      const int least = left.beta->image.at<cv::Vec3w>(row, column)[1];
      if (std::isnan(q[0])) {
        EXPECT_EQ(share + least, 0);
      } else if (column >= 160) {
        ++both;
        const int other = right.alpha->image.at<cv::Vec3w>(row, column - 160)[1];
        worst = std::max(worst, std::abs((share + other) / 65535.0 - 1));
        EXPECT_EQ(least, 0);
      } else {
        ++alone;
        worst = std::max(worst, std::abs(share / 65535.0 - 1));
        // When it is shown alone, the projector's light is its own black plus the other's black.
        const Vector3d p(q[0], q[1], q[2]);
        const double light = lookup(responses.projectors[0].green, least / 65535.0) - black[0];
        const double missing = black[1] * irradiance(1, p) / irradiance(0, p) * (1 - black[0]);
        worst_light = std::max(worst_light, std::abs(light / missing - 1));
      }
    }
  }
  EXPECT_GT(both, 20000);
  EXPECT_GT(alone, 20000);
  EXPECT_LT(worst, 1.0 / 255);
  EXPECT_LT(worst_light, 0.01);
}

// As Christie's Mystique writes it: XML alone, filesets beside an empty `files`, empty paths, and lenses in
// an extension that are no pinholes.
std::string christie_xml() {
  const auto region = [](const std::string& id, const std::string& eye, const std::string& angles) {
    return "<region id=\"" + id +
           R"(" xResolution="1400" yResolution="1050" x="0" y="0" xsize="1" ysize="1"><frustum>)" + angles +
           R"(<rightAngle>26.5650511770780</rightAngle><leftAngle>-26.5650511770780</leftAngle>
<upAngle>30</upAngle><downAngle>-10</downAngle></frustum><coordinateFrame>)" +
           eye + R"(<yawx>0.00000</yawx><yawy>0.00000</yawy><yawz>-1.00000</yawz>
<pitchx>1.00000</pitchx><pitchy>0.00000</pitchy><pitchz>0.00000</pitchz>
<rollx>0.00000</rollx><rolly>1.00000</rolly><rollz>0.00000</rollz></coordinateFrame></region>)";
  };
  const auto fileset = [](const std::string& id) {
    return "<fileset region=\"" + id + R"("><geometryWarpFile><geometricUnit>m</geometricUnit>
<originOf3DData>unknown</originOf3DData><path></path><interpolation>unknown</interpolation></geometryWarpFile>
<alphaMap><bitDepth>8</bitDepth><componentDepth>1</componentDepth><gammaEmbedded>1.00000</gammaEmbedded>
<path></path></alphaMap><distortionMap><path></path></distortionMap></fileset>)";
  };
  return R"(<?xml version="1.0" encoding="utf-8"?>
<MPCDI profile="sl" geometry="2" color="1" date="2018-11-23 14:25:51" version="2.0"><display><buffer id="head.cal">)" +
         region("Projector 1", "<posx>0.50000</posx><posy>-0.50000</posy><posz>0.00000</posz>",
                "<yaw>-45</yaw><pitch>0</pitch><roll>0</roll>") +
         region("Projector 2", "<posx>-0.00000</posx><posy>-1.00000</posy><posz>1.00000</posz>",
                "<yaw>0</yaw><pitch>-45</pitch><roll>90</roll>") +
         region("Projector 3", "<posx>0</posx><posy>-2</posy><posz>0</posz>",
                "<yaw>0</yaw><pitch>0</pitch><roll>0</roll>") +
         "</buffer></display><files></files>" + fileset("Projector 1") + fileset("Projector 2") +
         fileset("Projector 3") + R"(<extensionSet><extension Name="BufferExtension" hasExternalFiles="false">
<buffer id="head.cal"><region id="Projector 3"><fisheye><f1>75.0</f1></fisheye></region></buffer></extension>
<extension Name="MystiqueExtension" hasExternalFiles="false"><GeneratedBy>Mystique 2.1</GeneratedBy></extension>
</extensionSet></MPCDI>)";
}

TEST(Import, TakesProjectorsInChristiesForm) {
  const fs::path folder = test::test_folder();
  ASSERT_TRUE(write_file(folder / "head.mpcdi.xml", christie_xml()));
  const Mpcdi mpcdi = read_mpcdi(folder / "head.mpcdi.xml").value();
  EXPECT_EQ(mpcdi.made_by, "Mystique 2.1");
  ASSERT_EQ(mpcdi.regions.size(), 3u);
  EXPECT_EQ(mpcdi.regions[0].buffer, "head.cal");
  ASSERT_EQ(mpcdi.remarks.size(), 1u);
  EXPECT_NE(mpcdi.remarks[0].find("Projector 3"), std::string::npos);

  apps::ImportOptions options{folder / "head.mpcdi.xml", folder / "rig"};
  const Status status = apps::run_import(options);
  ASSERT_TRUE(status) << status.message();
  const Rig rig = load_rig(folder / "rig").value();
  ASSERT_EQ(rig.projectors.size(), 2u);
  const Imager& first = rig.projectors[0];
  EXPECT_EQ(first.name, "Projector 1");
  EXPECT_EQ(first.width, 1400);
  // Turned left by 45 degrees, it looks at the origin; z is up, so higher points are further up in its image.
  // At a distance of one, its image reaches one half to either side; it reaches down to -10 degrees.
  const double middle = 1050 * std::tan(30_deg) / (std::tan(30_deg) + std::tan(10_deg)) - 0.5;
  EXPECT_TRUE(near(*first.project({0, 0, 0}), Vector2d(699.5, middle), 1e-6));
  const double side = std::sqrt(0.5);
  EXPECT_TRUE(
      near(*first.project(Vector3d(side, side, 0) * std::sqrt(0.5) / 2), Vector2d(1399.5, middle), 1e-4));
  EXPECT_LT(first.project({0, 0, 0.1})->y(), middle);
  // The other one looks down at the origin with its right side turned down: +x is up in its image.
  const Imager& second = rig.projectors[1];
  EXPECT_TRUE(near(*second.project({0, 0, 0}), Vector2d(699.5, middle), 1e-6));
  EXPECT_LT(second.project({0.1, 0, 0})->y(), middle - 10);
  EXPECT_NEAR(second.project({0.1, 0, 0})->x(), 699.5, 1e-6);

  testing::internal::CaptureStdout();
  options.json = true;
  ASSERT_TRUE(apps::run_import(options));
  const json report = json::parse(testing::internal::GetCapturedStdout());
  EXPECT_EQ(report["regions"][1]["id"], "Projector 2");
  EXPECT_EQ(report["regions"][1]["frustum_deg"]["pitch"], -45);
}

// The numbers of Christie's published example: the projector points at the origin, 1.4 m away.
TEST(Import, AimsAPublishedProjectorWhereItWasAimed) {
  MpcdiRegion region;
  region.width = 1400;
  region.height = 1050;
  region.frustum =
      MpcdiFrustum{-54.649008076582298, 30.086445865802251, -35.258246325136348, -26.579532980277939,
                   26.536123041449411,  20.556835397199524, -20.543387795160175};
  region.frame = MpcdiFrame{{0.99906, -0.70781, -0.70934}, {1, 0, 0}, {0, 0, -1}, {0, 1, 0}};
  EXPECT_TRUE(near(*imager_of(region)->project({0, 0, 0}), Vector2d(699.5, 524.5), 5));
}

TEST(Import, KeepsDevicesInsideTheRigFolder) {
  const fs::path folder = test::test_folder();
  std::string xml = christie_xml();
  xml = std::regex_replace(xml, std::regex("Projector 1"), "../../P");
  xml = std::regex_replace(xml, std::regex("Projector 2"), ".._.._P");
  ASSERT_TRUE(make_folder(folder / "a/b"));
  ASSERT_TRUE(write_file(folder / "head.mpcdi.xml", xml));
  ASSERT_TRUE(apps::run_import({folder / "head.mpcdi.xml", folder / "a/b/rig"}));
  EXPECT_EQ(files_in(folder), (std::vector<std::string>{"a", "head.mpcdi.xml"}));
  EXPECT_EQ(files_in(folder / "a"), std::vector<std::string>{"b"});
  EXPECT_EQ(load_rig(folder / "a/b/rig")->projectors[1].name, ".._.._P_");
}

// A small archive of another program, version 1.0, for tests that damage it.
struct Foreign {
  std::string xml = R"(<?xml version="1.0"?>
<MPCDI profile="a3" level="1" date="2013-02-01 10:12:21" version="1.0">
<display><buffer id="b" Xresolution="40" Yresolution="20">
<region id="left" Xresolution="40" Yresolution="20" x="0" y="0" xsize="1" ysize="1"/></buffer></display>
<files><fileset region="left">
<geometryWarpFile><path>maps/left.pfm</path><interpolation>linear</interpolation><geometricUnit>mm</geometricUnit>
<originof3DData>floorCenter</originof3DData></geometryWarpFile>
<alphaMap><path>maps/left.png</path><componentDepth>1</componentDepth><bitDepth>8</bitDepth>
<gammaEmbedded>2.2</gammaEmbedded></alphaMap>
<betaMap><path>maps/black.png</path><componentDepth>3</componentDepth><bitDepth>16</bitDepth></betaMap>
</fileset></files></MPCDI>)";
  std::string pfm, alpha, beta;

  Foreign() {
    // Big-endian, a grid of 4x3 nodes, bottom row first.
    pfm = "PF 4 3 1\n";
    for (int node = 0; node < 12; ++node) {
      for (const float number : {100.0f * static_cast<float>(node), 1000.0f, node == 5 ? k_nan : -2000.0f}) {
        const auto bits = std::bit_cast<std::uint32_t>(number);
        for (int shift = 24; shift >= 0; shift -= 8) pfm += static_cast<char>(bits >> shift & 255);
      }
    }
    alpha = png(cv::Mat(20, 40, CV_8U, cv::Scalar(128)));
    beta = png(cv::Mat(20, 40, CV_16UC3, cv::Scalar(10, 20, 30)));
  }
  static std::string png(const cv::Mat& image) {
    std::vector<uchar> bytes;
    cv::imencode(".png", image, bytes);
    return {bytes.begin(), bytes.end()};
  }
  std::vector<ZipFile> files() const {
    return {{"maps/left.pfm", pfm}, {"mpcdi.xml", xml}, {"maps/left.png", alpha}, {"maps/black.png", beta}};
  }
  Result<Mpcdi> read() const { return read_bytes(zipped(files()).value()); }
  static Result<Mpcdi> read_bytes(const std::string& bytes) {
    const fs::path file = test::test_folder() / "foreign.mpcdi";
    EXPECT_TRUE(write_file(file, bytes));
    return read_mpcdi(file);
  }
};

TEST(Import, ReadsArchivesOfOtherPrograms) {
  const auto mpcdi = Foreign().read();
  ASSERT_TRUE(mpcdi) << mpcdi.message();
  EXPECT_EQ(mpcdi->version, "1.0");
  const MpcdiRegion& region = mpcdi->regions.at(0);
  ASSERT_EQ(region.warp.size(), cv::Size(4, 3));
  EXPECT_EQ(region.warp.at<cv::Vec3f>(2, 1), cv::Vec3f(0.1f, 1, -2)) << "metres, the bottom row last";
  EXPECT_EQ(region.warp.at<cv::Vec3f>(0, 3), cv::Vec3f(1.1f, 1, -2));
  EXPECT_TRUE(std::isnan(region.warp.at<cv::Vec3f>(1, 1)[0]));
  EXPECT_EQ(region.origin, "floorCenter");
  EXPECT_EQ(region.alpha->gamma_embedded, 2.2);
  EXPECT_EQ(region.alpha->image.at<std::uint8_t>(7, 7), 128);
  EXPECT_EQ(region.beta->image.at<cv::Vec3w>(19, 39), cv::Vec3w(10, 20, 30));
  EXPECT_FALSE(imager_of(region));
}

TEST(Import, ReadsPfmsWithoutAScale) {
  const cv::Mat image = (cv::Mat_<cv::Vec3f>(1, 2) << cv::Vec3f(1, 2, 3), cv::Vec3f(4, 5, 6));
  std::string bytes = pfm_bytes(image);
  const std::string scale = "-1.000000\n";
  bytes.erase(bytes.find(scale), scale.size());
  EXPECT_TRUE(is_same_bits(read_pfm(bytes, "warp", 100).value(), image));
}

TEST(Import, SaysWhatIsWrongWithAnArchive) {
  const auto failed = [](const std::string& says, const Result<Mpcdi>& read) {
    ASSERT_FALSE(read) << says;
    EXPECT_NE(read.message().find(says), std::string::npos) << read.message();
    EXPECT_NE(read.message().find("foreign.mpcdi"), std::string::npos) << read.message();
    EXPECT_FALSE(read.error().wrong_usage);
  };
  const auto with = [](const std::string& from, const std::string& to) {
    Foreign foreign;
    EXPECT_TRUE(std::regex_search(foreign.xml, std::regex(from))) << from;
    foreign.xml = std::regex_replace(foreign.xml, std::regex(from), to);
    return foreign.read();
  };
  failed("'maps/gone.png'", with("maps/left.png", "maps/gone.png"));
  failed("leads out", with("maps/left.png", "../left.png"));
  failed("leads out", with("maps/left.pfm", "/etc/passwd"));
  failed("leads out", with("maps/left.pfm", "maps/../../x"));
  failed("leads out", with("maps/black.png", R"(..\\x.png)"));
  failed("'right'", with("fileset region=\"left\"", "fileset region=\"right\""));
  failed("41x20", with("Xresolution=\"40\" Yresolution=\"20\" x", "Xresolution=\"41\" Yresolution=\"20\" x"));
  failed("xResolution", with("Xresolution=\"40\" Yresolution=\"20\" x", "x"));
  failed("whole pixels",
         with("Xresolution=\"40\" Yresolution=\"20\" x", "Xresolution=\"1e9\" Yresolution=\"20\" x"));
  failed("whole pixels",
         with("Xresolution=\"40\" Yresolution=\"20\" x", "Xresolution=\"-4\" Yresolution=\"20\" x"));
  failed("'four'",
         with("Xresolution=\"40\" Yresolution=\"20\" x", "Xresolution=\"four\" Yresolution=\"20\" x"));
  failed("profile", with("a3", "4d"));
  failed("version", with("version=\"1.0\">", "version=\"7\">"));
  failed("furlong", with("mm", "furlong"));
  failed("gammaEmbedded", with("2\\.2", "0"));
  failed("well-formed", with("</files>", "</filet>"));
  failed("MPCDI", with("MPCDI", "html"));
  failed("frustum", with("\"a3\"", "\"sl\""));
  failed("no other region", with("<region .*/>", "$&$&"));
  failed("at least one region", with("<region .*/>", ""));
  failed("right-handed", [] {
    std::string xml = christie_xml();
    xml.replace(xml.find("<rolly>1"), 8, "<rolly>-1");
    return Foreign::read_bytes(xml);
  }());
  failed("left 89", [] {
    std::string xml = christie_xml();
    xml.replace(xml.find("<leftAngle>-26"), 14, "<leftAngle>89");
    return Foreign::read_bytes(xml);
  }());
  failed("well-formed", Foreign::read_bytes("<MPCDI " + std::string(1000, '<')));
  failed("an empty file", Foreign::read_bytes(""));
  failed("7 other bytes", Foreign::read_bytes("JFIF..."));
  failed("truncated or damaged", Foreign::read_bytes("PK\x03\x04 and then something else"));
  failed("mpcdi.xml", Foreign::read_bytes(zipped({{"readme.txt", "nothing"}}).value()));

  Foreign foreign;
  foreign.pfm.resize(foreign.pfm.size() - 1);
  failed("bytes", foreign.read());
  foreign = {};
  foreign.pfm[1] = 'f';
  failed("PFM", foreign.read());
  foreign = {};
  foreign.pfm = pfm_bytes(cv::Mat(3, 4, CV_32FC3, cv::Scalar::all(std::numeric_limits<double>::quiet_NaN())));
  failed("at least one point", foreign.read());
  foreign.pfm = pfm_bytes(cv::Mat(3, 4, CV_32FC3, cv::Scalar::all(0)));
  failed("at least one point", foreign.read());
  foreign.pfm = pfm_bytes(cv::Mat(3, 41, CV_32FC3, cv::Scalar::all(1)));
  failed("41x3", foreign.read());
  foreign.pfm = "PF\n2000000000 2000000000\n-1\n";
  failed("pixels", foreign.read());
  foreign = {};
  foreign.alpha = Foreign::png(cv::Mat(20, 39, CV_8U, cv::Scalar(1)));
  failed("39x20", foreign.read());
  foreign.alpha = Foreign().alpha.substr(0, 50);
  failed("truncated", foreign.read());
  foreign.alpha = "GIF89a";
  failed("PNG", foreign.read());
}

TEST(Import, NamesAnArchiveThatWasCutAnywhere) {
  const std::string whole = zipped(Foreign().files()).value();
  ASSERT_TRUE(Foreign::read_bytes(whole));
  for (std::size_t k = 0; k < 20; ++k) {
    const auto read = Foreign::read_bytes(whole.substr(0, whole.size() * k / 20));
    ASSERT_FALSE(read) << k;
    EXPECT_NE(read.message().find("foreign.mpcdi: expected"), std::string::npos) << read.message();
  }
}

TEST(Import, SurvivesDamageAndNamesTheFile) {
  auto rng = test::test_rng();
  const auto damage = [&](std::string* bytes) {
    for (int n = 0; n < 3; ++n) (*bytes)[rng() % bytes->size()] = static_cast<char>(rng());
  };
  int refused = 0;
  for (int k = 0; k < 400; ++k) {
    Foreign foreign;
    std::string* const inside[] = {&foreign.xml, &foreign.pfm, &foreign.alpha, &foreign.beta};
    if (k % 5 < 4) damage(inside[k % 5]);
    std::string bytes = zipped(foreign.files()).value();
    if (k % 5 == 4) damage(&bytes);
    const auto read = Foreign::read_bytes(bytes);
    if (read) continue;
    ++refused;
    EXPECT_NE(read.message().find("foreign.mpcdi"), std::string::npos) << read.message();
  }
  EXPECT_GT(refused, 100);  // changed names, dates, points and so on do no harm
}

TEST(Import, UnpacksNoBomb) {
  Foreign foreign;
  foreign.pfm = std::string(std::size_t{200} << 20, '\0');
  std::string bytes = zipped(foreign.files()).value();
  ASSERT_LT(bytes.size(), 2'000'000u);
  const auto says = [](const Result<Mpcdi>& read, const std::string& what) {
    ASSERT_FALSE(read);
    EXPECT_NE(read.message().find(what), std::string::npos) << read.message();
  };
  says(Foreign::read_bytes(bytes), "when unpacked");
  // The archive states a wrong size (little-endian, in the file's own header and in the directory).
  const std::string truth("\x00\x00\x80\x0c", 4), lie("\x90\x00\x00\x00", 4);
  int lies = 0;
  for (auto at = bytes.find(truth); at != std::string::npos; at = bytes.find(truth, at + 4), ++lies)
    bytes.replace(at, 4, lie);
  ASSERT_GE(lies, 1);
  EXPECT_FALSE(Foreign::read_bytes(bytes));

  foreign = {};
  foreign.alpha = Foreign::png(cv::Mat(20000, 20000, CV_8U, cv::Scalar(0)));
  says(foreign.read(), "20000x20000");
  foreign = {};
  foreign.xml = "<MPCDI>" + std::string(std::size_t{40} << 20, ' ') + "</MPCDI>";
  says(foreign.read(), "mpcdi.xml");
}

}  // namespace
}  // namespace limn::exchange
