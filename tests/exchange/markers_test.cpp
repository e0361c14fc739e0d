#include "apps/markers.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/learn_body.h"
#include "core/cameramodel.h"
#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"
#include "tests/tracker/marker_images.h"
#include "tracker/detector.h"

namespace limn::exchange {
namespace {

// Draws a printed sheet of 40 mm markers at 5 px per mm and detects its markers: these ids, upright, in true
// size.
void expect_printed(const std::string& family,
                    const std::string& ids,
                    const std::set<std::string>& expected) {
  const auto folder = test::test_folder();
  apps::MarkersOptions options;
  options.family = family;
  options.ids = ids;
  options.out = folder / "sheet.pdf";
  ASSERT_TRUE(apps::run_markers(options));
  EXPECT_EQ(read_file(options.out).value().rfind("%PDF", 0), 0u);
  const std::string render =
      "pdftoppm -r 127 -png '" + options.out.string() + "' '" + (folder / "page").string() + "'";
  ASSERT_EQ(std::system(render.c_str()), 0)
      << "pdftoppm failed or is missing (poppler-utils, tests/packages.txt)";
  const auto grey = read_grey_image(folder / "page-1.png");
  ASSERT_TRUE(grey) << grey.message();
  std::set<std::string> found_ids;
  tracker::Detector detector(tracker::Families::load(std::vector<std::string>{family}).value());
  for (const auto& found : detector.detect(*grey)) {
    found_ids.insert(found.marker.id);
    EXPECT_NEAR((found.corners_px[1] - found.corners_px[0]).norm(), 200, 0.3);
    EXPECT_LT(found.corners_px[0].x(), found.corners_px[1].x());
    EXPECT_LT(found.corners_px[0].y(), found.corners_px[3].y());
  }
  EXPECT_EQ(found_ids, expected);
}

TEST(Markers, PrintTrueToSizeAndAreFound) {
  expect_printed("aruco_4x4_50", "0-3,17,20-22", {"0", "1", "2", "3", "17", "20", "21", "22"});
}

TEST(Markers, PrintedBarcodesAreFound) {
  expect_printed("artoolkit_3x3", "0-5,63", {"0", "1", "2", "3", "4", "5", "63"});
}

TEST(Markers, PrintedAprilTag3MarkersAreFound) {
  expect_printed("apriltag_41h12", "0-2,2114", {"0", "1", "2", "2114"});
  expect_printed("apriltag_21h7", "0,37", {"0", "37"});
}

TEST(Markers, PrintedInvertedAndMipMarkersAreFound) {
  expect_printed("aruco_4x4_50_inverted", "0-3", {"0", "1", "2", "3"});
  expect_printed("aruco_mip_36h12", "0,249", {"0", "249"});
}

TEST(Markers, AHolderForCellsAroundTheSquareIsRefused) {
  apps::MarkersOptions options;
  options.family = "apriltag_41h12";
  options.mount = test::test_folder() / "holder.stl";
  const Status status = apps::run_markers(options);
  ASSERT_FALSE(status);
  EXPECT_TRUE(status.error().wrong_usage);
  EXPECT_NE(status.message().find("--mount"), std::string::npos);
}

TEST(Markers, DrawSvgPages) {
  apps::MarkersOptions options;
  options.ids = "0-30";
  options.out = test::test_folder() / "sheet.svg";
  ASSERT_TRUE(apps::run_markers(options));
  EXPECT_TRUE(read_file(options.out));
  EXPECT_TRUE(read_file(options.out.parent_path() / "sheet-2.svg"));
}

TEST(Markers, DrawABoardWithItsScale) {
  apps::MarkersOptions options;
  for (const char* board : {"chessboard:9x7:20mm", "aprilgrid:6x6:88mm:0.3"})
    for (const char* name : {"board.pdf", "board.png", "board.svg"}) {
      options.board = board;
      options.out = test::test_folder() / name;
      const Status status = apps::run_markers(options);
      EXPECT_TRUE(status) << status.message();
    }
}

TEST(Markers, TellWrongUsage) {
  const auto folder = test::test_folder();
  const auto wrong = [&](const apps::MarkersOptions& options) {
    const Status status = apps::run_markers(options);
    return !status && status.error().wrong_usage;
  };
  apps::MarkersOptions good;
  good.out = folder / "a.pdf";
  ASSERT_TRUE(apps::run_markers(good));
  for (const char* ids : {"", "a", "3-1", "1,,2", "99"}) {
    apps::MarkersOptions bad = good;
    bad.ids = ids;
    EXPECT_TRUE(wrong(bad)) << ids;
  }
  apps::MarkersOptions bad = good;
  bad.size_mm = 500;
  EXPECT_TRUE(wrong(bad));
  bad = good;
  bad.out = folder / "a.docx";
  EXPECT_TRUE(wrong(bad));
  bad = good;
  bad.family = "nonsense";
  EXPECT_TRUE(wrong(bad));
}

// Images of a plate with four markers, one of them bent up, turned in front of a camera with lens distortion.
TEST(Markers, LearnABodyFromItsImages) {
  using namespace test::literals;
  auto rng = test::test_rng();
  const auto folder = test::test_folder();
  const Imager camera = {
      "camera0", 800, 600,
      Lens::create("LENSMODEL_OPENCV4", {900, 902, 402, 297, -0.12, 0.05, 1e-4, -2e-4}).value(), Pose{}};
  ASSERT_TRUE(save_cameramodel(camera, folder / "camera0.cameramodel"));
  const std::array<Pose, 4> body_from_marker = {Pose(exp_rotation({0, 0, 0.2}), {-0.05, -0.05, 0}),
                                                Pose(exp_rotation({0, 0, -0.4}), {0.05, -0.05, 0}),
                                                Pose(exp_rotation({0.5, 0, 0}), {-0.05, 0.05, -0.01}),
                                                Pose(exp_rotation({0, 0.3, 1}), {0.05, 0.05, 0.005})};
  apps::LearnBodyOptions options;
  options.camera = folder / "camera0.cameramodel";
  options.family = "aruco_4x4_50";
  options.size_mm = 50;
  options.out = folder / "plate.json";
  for (int image = 0; image < 8; ++image) {
    const double a = 0.25 * M_PI * image;
    const Pose camera_from_body(exp_rotation({0.5 * std::cos(a), 0.5 * std::sin(a), 0.1 * image}),
                                {0.01, 0, 0.45});
    std::vector<test::PlacedMarker> markers;
    for (std::size_t i = 0; i < 4; ++i)
      markers.push_back({{"aruco_4x4_50", std::to_string(i)}, camera_from_body * body_from_marker[i], 0.05});
    options.images.push_back(folder / fmt::format("{}.png", image));
    ASSERT_TRUE(
        write_png(options.images.back(), test::image_of(camera.lens, test::plain(800, 600, 100), markers,
                                                        {.blur_px = 0.6, .noise_levels = 2}, rng)));
  }
  const Status status = apps::run_learn_body(options);
  ASSERT_TRUE(status) << status.message();
  const auto body = test::read_json(options.out);
  EXPECT_EQ(body["schema"], "limn.body/1");
  EXPECT_EQ(body["pictures"], 8);
  ASSERT_EQ(body["markers"].size(), 4u);
  const auto config = Config::load(options.out, "limn.body/1");
  ASSERT_TRUE(config) << config.message();
  const auto found = config->root().at("markers").items();
  const Pose frame =
      body_from_marker[static_cast<std::size_t>(std::stoi(body["frame"].get<std::string>().substr(13)))];
  for (std::size_t i = 0; i < 4; ++i) {
    const Pose expected = frame.inverse() * body_from_marker[i];
    EXPECT_TRUE(test::pose_near(found[i].at("body_from_marker").pose(), expected, 0.2_deg, 0.15_mm)) << i;
    EXPECT_LT(found[i].at("stddev_mm").numbers(3)[2], 0.3);
  }
  const std::string before = read_file(options.out).value();
  ASSERT_TRUE(apps::run_learn_body(options));
  EXPECT_EQ(read_file(options.out).value(), before);
  options.images.resize(1);
  options.family = "apriltag_36h11";
  EXPECT_NE(apps::run_learn_body(options).message().find("two or more markers"), std::string::npos);
  options.camera.clear();
  EXPECT_TRUE(apps::run_learn_body(options).error().wrong_usage);
}

TEST(Markers, TrainedTemplatesAreComparedWithOthers) {
  const auto folder = test::test_folder();
  cv::Mat image(400, 400, CV_8UC3, cv::Scalar(230, 230, 230));
  image(cv::Rect(100, 100, 200, 200)).setTo(cv::Scalar(20, 20, 20));
  image(cv::Rect(150, 150, 100, 100)).setTo(cv::Scalar(200, 220, 240));
  image(cv::Rect(150, 150, 40, 70)).setTo(cv::Scalar(20, 20, 20));
  ASSERT_TRUE(write_png(folder / "photo.png", image));
  apps::MarkersOptions train;
  train.train = folder / "photo.png";
  train.out = folder / "new.patt";
  const Status trained = apps::run_markers(train);
  ASSERT_TRUE(trained) << trained.message();
  ASSERT_TRUE(write_file(folder / "copy.patt", read_file(train.out).value()));
  apps::MarkersOptions compare;
  compare.compare = {folder / "new.patt", folder / "copy.patt"};
  compare.json = folder / "pairs.json";
  const Status compared = apps::run_markers(compare);
  ASSERT_TRUE(compared) << compared.message();
  const std::string json = read_file(compare.json).value();
  EXPECT_NE(json.find("\"verdict\": \"confused\""), std::string::npos) << json;
  train.out = folder / "new.txt";
  const Status wrong = apps::run_markers(train);
  EXPECT_TRUE(!wrong && wrong.error().wrong_usage);
}

}  // namespace
}  // namespace limn::exchange
