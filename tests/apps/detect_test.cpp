#include "apps/detect.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "core/rig.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"
#include "tests/support/run_limn.h"
#include "tracker/family.h"

namespace limn::apps {
namespace {

// A marker of 80 px, upright, its top-left corner at (99.5, 79.5).
cv::Mat image_with_marker() {
  cv::Mat image(240, 320, CV_8UC1, cv::Scalar(220));
  const cv::Mat marker = tracker::draw_marker({"apriltag_36h11", "7"}, 10).value();
  marker.copyTo(image(cv::Rect(100, 80, marker.cols, marker.rows)));
  return image;
}

struct Detect : testing::Test {
  std::filesystem::path folder = test::test_folder();
  DetectOptions options;
  void SetUp() override {
    ASSERT_TRUE(write_png(folder / "a.png", image_with_marker()));
    options.images = {folder / "a.png"};
    options.csv = folder / "a.csv";
    options.json = folder / "a.json";
  }
  std::filesystem::path camera(int width) {
    const auto path = folder / "camera.cameramodel";
    EXPECT_TRUE(
        save_cameramodel({"camera", width, 240, Lens::pinhole(400, 400, 159.5, 119.5), Pose()}, path));
    return path;
  }
};

TEST_F(Detect, WritesCornersAndPoses) {
  options.camera = camera(320);
  options.size_mm = 80;
  options.draw = folder / "drawn";
  options.repeat = 3;
  const Status status = run_detect(options);
  ASSERT_TRUE(status) << status.message();
  const auto json = test::read_json(options.json);
  const auto& image = json["images"][0];
  EXPECT_GT(image["ms"].get<double>(), 0);
  ASSERT_EQ(image["markers"].size(), 1u);
  const auto& marker = image["markers"][0];
  EXPECT_EQ(marker["family"], "apriltag_36h11");
  EXPECT_EQ(marker["id"], 7);
  EXPECT_NEAR(marker["corners_px"][0][0].get<double>(), 99.5, 0.02);
  EXPECT_NEAR(marker["corners_px"][0][1].get<double>(), 79.5, 0.02);
  EXPECT_NEAR(marker["poses"][0]["camera_from_marker"]["translation_m"][2].get<double>(), 0.4, 1e-3);
  EXPECT_EQ(marker["poses"][0]["covariance"].size(), 6u);
  EXPECT_TRUE(read_image(options.draw / "a.png"));
  EXPECT_EQ(read_file(options.csv)
                .value()
                .rfind("file,id,x0,y0,x1,y1,x2,y2,x3,y3,score\na.png,apriltag_36h11:7,99.", 0),
            0u);
}

TEST_F(Detect, OffersThePapersPose) {
  options.camera = camera(320);
  options.size_mm = 80;
  options.pose = PoseMethod::triangle;
  ASSERT_TRUE(run_detect(options));
  const auto json = test::read_json(options.json);
  const auto& poses = json["images"][0]["markers"][0]["poses"];
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_NEAR(poses[0]["camera_from_marker"]["translation_m"][2].get<double>(), 0.4, 1e-3);
}

TEST_F(Detect, NamesOnlyTheIdWithOneFamily) {
  options.families = {"apriltag_36h11"};
  ASSERT_TRUE(run_detect(options));
  EXPECT_NE(read_file(options.csv).value().find("\na.png,7,"), std::string::npos);
}

TEST_F(Detect, SaysBothSizesWhenTheCameraIsAnother) {
  options.camera = camera(640);
  const Status status = run_detect(options);
  EXPECT_FALSE(status);
  EXPECT_FALSE(status.error().wrong_usage);
}

TEST_F(Detect, GoesOnAfterABadImage) {
  ASSERT_TRUE(write_file(folder / "bad.png", "no picture"));
  options.images = {folder / "bad.png", folder / "absent.png", folder / "a.png"};
  options.threads = 3;
  const Status status = run_detect(options);
  ASSERT_FALSE(status);
  EXPECT_NE(status.message().find("2 of 3"), std::string::npos);
  EXPECT_EQ(test::read_json(options.json)["images"].size(), 1u);
}

TEST_F(Detect, ReadsImagesOfAllDepthsAndChannels) {
  cv::Mat wide, four;
  image_with_marker().convertTo(wide, CV_16U, 257);
  ASSERT_TRUE(write_png(folder / "wide.png", wide));
  cv::cvtColor(image_with_marker(), four, cv::COLOR_GRAY2BGRA);
  ASSERT_TRUE(write_png(folder / "four.png", four));
  cv::cvtColor(wide, four, cv::COLOR_GRAY2BGRA);
  ASSERT_TRUE(write_png(folder / "wide_four.png", four));
  options.images = {folder / "a.png", folder / "wide.png", folder / "four.png", folder / "wide_four.png"};
  const Status status = run_detect(options);
  ASSERT_TRUE(status) << status.message();
  const auto images = test::read_json(options.json)["images"];
  ASSERT_EQ(images.size(), 4u);
  for (const auto& image : images) EXPECT_EQ(image["markers"], images[0]["markers"]) << image["file"];
}

TEST_F(Detect, ReadsImagesOfAllFormats) {
  options.images = {folder / "a.png"};
  for (const char* extension : {".bmp", ".pgm", ".tiff", ".webp", ".jpg"}) {
    std::vector<uchar> bytes;
    cv::imencode(extension, image_with_marker(), bytes, {cv::IMWRITE_WEBP_QUALITY, 101});
    options.images.push_back(folder / (std::string("b") + extension));
    ASSERT_TRUE(
        write_file(options.images.back(), {reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
  }
  const Status status = run_detect(options);
  ASSERT_TRUE(status) << status.message();
  const auto images = test::read_json(options.json)["images"];
  ASSERT_EQ(images.size(), 6u);
  for (const auto& image : images) {
    ASSERT_EQ(image["markers"].size(), 1u) << image["file"];
    EXPECT_NEAR(image["markers"][0]["corners_px"][0][0].get<double>(), 99.5, 0.1) << image["file"];
  }
}

TEST_F(Detect, FindsMarkersInBitsAtTheLowEnd) {
  options.images = {folder / "a.png"};
  for (const int bits : {10, 12}) {
    cv::Mat deep;
    image_with_marker().convertTo(deep, CV_16U, 1 << (bits - 8));
    options.images.push_back(folder / fmt::format("mono{}.png", bits));
    ASSERT_TRUE(write_png(options.images.back(), deep));
  }
  ASSERT_TRUE(run_detect(options));
  const auto images = test::read_json(options.json)["images"];
  ASSERT_EQ(images.size(), 3u);
  for (const auto& image : images) EXPECT_EQ(image["markers"], images[0]["markers"]) << image["file"];
}

TEST_F(Detect, ShowsTransparentPaperOnWhite) {
  cv::Mat bgra;
  cv::cvtColor(image_with_marker(), bgra, cv::COLOR_GRAY2BGRA);
  bgra.setTo(cv::Scalar(0, 0, 0, 0), image_with_marker() > 200);  // the paper
  ASSERT_TRUE(write_png(folder / "sticker.png", bgra));
  options.images = {folder / "sticker.png"};
  ASSERT_TRUE(run_detect(options));
  const auto image = test::read_json(options.json)["images"][0];
  ASSERT_EQ(image["markers"].size(), 1u);
  EXPECT_EQ(image["markers"][0]["id"], 7);
}

TEST_F(Detect, QuotesNamesInCsvAndReplacesBytesThatAreNotUtf8) {
  options.images.clear();
  for (const char* name : {"a,b.png", "say \"hi\".png", "caf\xe9 1.png"}) {
    options.images.push_back(folder / name);
    ASSERT_TRUE(write_png(options.images.back(), image_with_marker()));
  }
  ASSERT_TRUE(run_detect(options));
  const std::string csv = read_file(options.csv).value();
  for (const char* row :
       {"\n\"a,b.png\",apriltag_36h11:7,99.", "\n\"say \"\"hi\"\".png\",apriltag_36h11:7,99.",
        "\ncaf\xef\xbf\xbd 1.png,apriltag_36h11:7,99."})
    EXPECT_NE(csv.find(row), std::string::npos) << csv;
  const auto images = test::read_json(options.json)["images"];
  EXPECT_EQ(images[0]["file"], "a,b.png");
  EXPECT_EQ(images[2]["file"], "caf\xef\xbf\xbd 1.png");
}

TEST_F(Detect, ImagesOfOneNameAreToldApart) {
  for (const char* side : {"left", "right"}) {
    ASSERT_TRUE(make_folder(folder / side));
    ASSERT_TRUE(write_png(folder / side / "000.png", image_with_marker()));
  }
  options.images = {folder / "left/000.png", folder / "right/000.png", folder / "a.png"};
  options.draw = folder / "drawn";
  ASSERT_TRUE(run_detect(options));
  const std::string csv = read_file(options.csv).value();
  for (const std::string& name :
       {(folder / "left/000.png").string(), (folder / "right/000.png").string(), std::string("a.png")})
    EXPECT_NE(csv.find("\n" + name + ","), std::string::npos) << csv;
  for (const char* drawing : {"left-000.png", "right-000.png", "a.png"})
    EXPECT_TRUE(read_image(options.draw / drawing)) << drawing;
  EXPECT_EQ(test::read_json(options.json)["images"][1]["drawing"], (options.draw / "right-000.png").string());
}

TEST_F(Detect, DrawsBesideTheImagesWithoutReplacingThem) {
  const std::string original = read_file(folder / "a.png").value();
  std::filesystem::create_hard_link(folder / "a.png", folder / "b.png");
  std::filesystem::create_symlink("a.png", folder / "c.png");
  options.images = {folder / "b.png", folder / "c.png", folder / "a.png"};
  options.draw = folder;
  ASSERT_TRUE(run_detect(options));
  for (const char* name : {"a.png", "b.png", "c.png"}) {
    EXPECT_EQ(read_file(folder / name).value(), original) << name;
    EXPECT_TRUE(read_image(folder / (std::string(1, *name) + "-drawn.png"))) << name;
  }
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "c.png"));
}

TEST_F(Detect, OutputsThatAreInputsAreWrongUsage) {
  const std::string image = (folder / "a.png").string();
  const std::string original = read_file(image).value();
  std::filesystem::create_symlink("a.png", folder / "link.csv");
  for (const auto& outputs : std::vector<std::vector<std::string>>{
           {"--csv", image},
           {"--json", image},
           {"--csv", (folder / "link.csv").string()},
           {"--csv", (folder / "x").string(), "--json", (folder / "x").string()}}) {
    std::vector<std::string> arguments = {"detect", image};
    arguments.insert(arguments.end(), outputs.begin(), outputs.end());
    const test::Outcome outcome = test::run_limn(arguments);
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_NE(outcome.err.find("expected a file of its own"), std::string::npos) << outcome.err;
  }
  const test::Outcome camera = test::run_limn({"detect", image, "--camera", this->camera(320).string(),
                                               "--json", (folder / "camera.cameramodel").string()});
  EXPECT_EQ(camera.code, 2) << camera.err;
  EXPECT_EQ(read_file(image).value(), original);
}

TEST_F(Detect, FindsNothingInImagesOfNothing) {
  options.images.clear();
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 400}, {400, 1}, {2, 2}, {320, 240}})
    for (const int level : {0, 255}) {
      options.images.push_back(folder / fmt::format("{}x{}_{}.png", width, height, level));
      ASSERT_TRUE(write_png(options.images.back(), cv::Mat(height, width, CV_8UC1, cv::Scalar(level))));
    }
  cv::Mat noise(240, 320, CV_8UC3);
  cv::randu(noise, 0, 256);
  options.images.push_back(folder / "noise.png");
  ASSERT_TRUE(write_png(options.images.back(), noise));
  const Status status = run_detect(options);
  ASSERT_TRUE(status) << status.message();
  const auto images = test::read_json(options.json)["images"];
  EXPECT_EQ(images.size(), options.images.size());
  for (const auto& image : images) EXPECT_TRUE(image["markers"].empty()) << image["file"];
}

TEST_F(Detect, TellsWrongUsage) {
  options.families = {"nonsense"};
  EXPECT_TRUE(run_detect(options).error().wrong_usage);
  options.families = {"aruco_4x4_50"};
  options.size_mm = 80;  // without a camera
  EXPECT_TRUE(run_detect(options).error().wrong_usage);
}

}  // namespace
}  // namespace limn::apps
