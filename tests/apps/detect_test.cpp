#include "apps/detect.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "core/rig.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"
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
