#include "apps/patterns.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "calib/patterns.h"
#include "core/picture.h"
#include "tests/support/matchers.h"

namespace limn::apps {
namespace {

TEST(PatternsCommand, WritesNumberedPicturesAndTheirDescription) {
  const auto out = test::test_folder() / "patterns";
  const Status status = run_patterns({.projector = "40x24", .out = out});
  ASSERT_TRUE(status.ok()) << status.message();
  const auto patterns = calib::load_patterns(out / "patterns.json");
  ASSERT_TRUE(patterns.ok()) << patterns.message();
  EXPECT_EQ(patterns->count(), 24);
  const auto last = read_picture(out / "023.png");
  ASSERT_TRUE(last.ok()) << last.message();
  EXPECT_TRUE(test::image_near(*last, cv::Mat(24, 40, CV_8U, cv::Scalar(0)), 0, 0, "black"));
  EXPECT_TRUE(test::image_near(read_picture(out / "022.png").value(), cv::Mat(24, 40, CV_8U, cv::Scalar(255)),
                               0, 0, "white"));
  EXPECT_FALSE(std::filesystem::exists(out / "024.png"));
}

TEST(PatternsCommand, CallsWrongOptionsWrongUsage) {
  const auto out = test::test_folder() / "patterns";
  for (const char* size :
       {"", "1280", "1280x", "x800", "1280x800x3", "-5x800", "0x0", "1280 x 800", "99999x800"}) {
    const Status status = run_patterns({.projector = size, .out = out});
    ASSERT_FALSE(status.ok()) << size;
    EXPECT_TRUE(status.error().wrong_usage) << size;
  }
  const Status code = run_patterns({.projector = "40x24", .code = "phase", .out = out});
  ASSERT_FALSE(code.ok());
  EXPECT_TRUE(code.error().wrong_usage);
  EXPECT_NE(code.message().find("gray"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(out));
}

}  // namespace
}  // namespace limn::apps
