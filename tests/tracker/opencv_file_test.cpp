#include "tracker/opencv_file.h"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/core.hpp>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn::tracker {
namespace {

OpencvFile parsed(const std::string& text) { return OpencvFile::parse(text).value(); }

std::string message(const std::string& text) {
  const auto file = OpencvFile::parse(text);
  return file ? std::string("read") : file.message();
}

struct OpencvFileOf : testing::TestWithParam<const char*> {};

// A file that OpenCV itself writes, with everything that can be around the values that Limn reads.
TEST_P(OpencvFileOf, HoldsWhatOpencvWrote) {
  const auto path = test::test_folder() / (std::string("written.") + GetParam());
  const cv::Mat matrix = (cv::Mat_<double>(2, 3) << 450.25, 0, -317, 1e-20, 1e300, 3);
  {
    cv::FileStorage file(path.string(), cv::FileStorage::WRITE);
    file << "time"
         << "Fri: 12 # no comment";
    file << "image_width" << 640;
    file << "list"
         << "[" << 1 << "two"
         << "["
         << "a"
         << "]"
         << "{"
         << "rows" << 7 << "}"
         << "]";
    file << "map"
         << "{"
         << "x" << 1 << "image_width" << 7 << "}";
    file << "matrix" << matrix;
    file << "long" << cv::Mat(3, 50, CV_32FC2, cv::Scalar(1.5, 2.5));
    file.writeComment("a comment: 1");
    file << "digits"
         << "0101";
    file << "nothing"
         << "";
    file << "empty" << cv::Mat();
  }
  const OpencvFile file = parsed(read_file(path).value());
  EXPECT_EQ(file.find("time")->text, "Fri: 12 # no comment");
  EXPECT_EQ(file.integer("image_width"), 640);
  EXPECT_EQ(file.find("matrix")->numbers, (std::vector<double>{450.25, 0, -317, 1e-20, 1e300, 3}));
  EXPECT_EQ(file.find("matrix")->rows, 2);
  EXPECT_EQ(file.find("matrix")->cols, 3);
  EXPECT_EQ(file.find("long")->numbers.size(), 300u);
  EXPECT_EQ(file.find("digits")->text, "0101");
  EXPECT_EQ(file.find("nothing")->text, "");
  EXPECT_TRUE(file.find("empty")->numbers.empty());
  EXPECT_EQ(file.find("x"), nullptr);
  EXPECT_EQ(file.integer("time"), std::nullopt);
}

INSTANTIATE_TEST_SUITE_P(Kinds, OpencvFileOf, testing::Values("yml", "xml", "json"));

TEST(OpencvFile, SaysWhatIsDamaged) {
  EXPECT_NE(message("").find("empty"), std::string::npos);
  EXPECT_NE(message("%YAML:1.0\n---\na: 1\n- 2\n").find("line 4"), std::string::npos);
  EXPECT_NE(message("a: 1\n\tb: 2\n").find("line 2"), std::string::npos);
  EXPECT_NE(message("m: !!opencv-matrix\n   rows: 1\n   data: [ 1, 2").find("line 3"), std::string::npos);
  EXPECT_NE(message("m: !!opencv-matrix\n   data: [ 1, x ]\n").find("m: expected"), std::string::npos);
  EXPECT_NE(message("<opencv_storage><a>1</a>").find("line 1: expected XML"), std::string::npos);
  EXPECT_NE(message("<opencv_storage>\n</a></opencv_storage>").find("line 2: expected XML"),
            std::string::npos);
  EXPECT_NE(message("<storage></storage>").find("opencv_storage"), std::string::npos);
  EXPECT_NE(message("{\"a\": [").find("expected JSON"), std::string::npos);
  EXPECT_NE(message("{\"a\": " + std::string(1000, '[') + std::string(1000, ']') + "}").find("64 deep"),
            std::string::npos);
  EXPECT_NE(message("a: &x [1]\nb: *x\n").find("line 2: expected no alias"), std::string::npos);
}

TEST(OpencvFile, KeepsNumbersThatAreNone) {
  const auto numbers = parsed("m: !!opencv-matrix\n   data: [ .Nan, -.Inf, 1. ]\n").find("m")->numbers;
  ASSERT_EQ(numbers.size(), 3u);
  EXPECT_TRUE(std::isnan(numbers[0]));
  EXPECT_EQ(numbers[1], -std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace limn::tracker
