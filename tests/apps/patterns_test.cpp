#include "apps/patterns.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "calib/code/patterns.h"
#include "calib/response/response_patterns.h"
#include "core/file.h"
#include "core/image_io.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"

namespace limn::apps {
namespace {

TEST(PatternsCommand, WritesNumberedImagesAndTheirDescription) {
  const auto out = test::test_folder() / "patterns";
  const Status status = run_patterns({.projector = "40x24", .out = out});
  ASSERT_TRUE(status.ok()) << status.message();
  const auto patterns = calib::load_patterns(out / "patterns.json");
  ASSERT_TRUE(patterns.ok()) << patterns.message();
  EXPECT_EQ(patterns->count(), 24);
  const auto last = read_image(out / "023.png");
  ASSERT_TRUE(last.ok()) << last.message();
  EXPECT_TRUE(test::image_near(*last, cv::Mat(24, 40, CV_8U, cv::Scalar(0)), 0, 0, "black"));
  EXPECT_TRUE(test::image_near(read_image(out / "022.png").value(), cv::Mat(24, 40, CV_8U, cv::Scalar(255)),
                               0, 0, "white"));
  EXPECT_FALSE(std::filesystem::exists(out / "024.png"));
}

TEST(PatternsCommand, WritesTheResponseImages) {
  const auto out = test::test_folder() / "response";
  const Status status = run_patterns({.projector = "40x24", .response = true, .out = out});
  ASSERT_TRUE(status.ok()) << status.message();
  const int count = static_cast<int>(calib::response_images().size());
  EXPECT_LE(count, 60);
  for (const int i : {0, 1, 5, 20, count - 1}) {
    const auto image = read_image(out / calib::image_name(i));
    ASSERT_TRUE(image.ok()) << image.message();
    EXPECT_TRUE(test::image_near(*image, calib::draw_response(i, 40, 24), 0, 0, "response"));
  }
  EXPECT_FALSE(std::filesystem::exists(out / calib::image_name(count)));
  const auto list = test::read_json(out / "patterns.json");
  EXPECT_EQ(list["pictures"].size(), static_cast<std::size_t>(count));
  EXPECT_EQ(list["pictures"][0]["shows"], "black");
}

TEST(PatternsCommand, DrawsWavesByAMeasuredResponse) {
  const auto folder = test::test_folder();
  ASSERT_TRUE(make_folder(folder).ok());
  const auto curve = [](const char* name, const char* values) {
    return fmt::format(R"({{"name": "{}", "red": {}, "green": {}, "blue": {}}})", name, values, values,
                       values);
  };
  const std::string left = curve("left", "[0, 1]"), right = curve("right", "[0, 0.1, 1]");
  const auto file = [&](const std::string& projectors) {
    EXPECT_TRUE(write_file(folder / "response.json",
                           R"({"schema": "limn.response/1", "projectors": [)" + projectors + "]}")
                    .ok());
    return folder / "response.json";
  };
  PatternsOptions options{
      .projector = "40x24", .code = calib::PatternCode::phase, .out = folder / "patterns"};
  options.linearise = file(left);
  const Status status = run_patterns(options);
  ASSERT_TRUE(status.ok()) << status.message();
  const auto patterns = calib::load_patterns(options.out / "patterns.json").value();
  const cv::Mat wave = read_image(options.out / calib::image_name(patterns.first_step())).value();
  EXPECT_EQ(wave.at<cv::Vec3b>(0, 4), cv::Vec3b(128, 128, 128)) << "half the light, a quarter of a wave away";

  options.linearise = file(left + ", " + right);
  EXPECT_TRUE(run_patterns(options).error().wrong_usage) << "which of them?";
  options.name = "middle";
  EXPECT_NE(run_patterns(options).message().find("middle, found those of left, right"), std::string::npos);
  options.name = "right";
  EXPECT_TRUE(run_patterns(options).ok());
  options.code = calib::PatternCode::gray;
  EXPECT_TRUE(run_patterns(options).error().wrong_usage);
}

TEST(PatternsCommand, CallsWrongOptionsWrongUsage) {
  const auto out = test::test_folder() / "patterns";
  for (const char* size :
       {"", "1280", "1280x", "x800", "1280x800x3", "-5x800", "0x0", "1280 x 800", "99999x800"}) {
    const Status status = run_patterns({.projector = size, .out = out});
    ASSERT_FALSE(status.ok()) << size;
    EXPECT_TRUE(status.error().wrong_usage) << size;
  }
  EXPECT_FALSE(std::filesystem::exists(out));
}

}  // namespace
}  // namespace limn::apps
