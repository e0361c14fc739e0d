#include "calib/patterns.h"

#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

TEST(Patterns, CountAsOpenCVDoes) {
  EXPECT_EQ(Patterns::create("gray", 1024, 768)->count(), 42);
  EXPECT_EQ(Patterns::create("gray", 1280, 800)->count(), 44);
  EXPECT_EQ(Patterns::create("gray", 2, 2)->count(), 6);
}

TEST(Patterns, GiveEveryPixelItsOwnCodeInTheStatedOrder) {
  const Patterns patterns = Patterns::create("gray", 13, 6).value();
  const int column_bits = patterns.column_bits(), row_bits = patterns.row_bits();
  ASSERT_EQ(column_bits, 4);
  ASSERT_EQ(row_bits, 3);
  auto value = [&](int first, int bits, int x, int y) {  // Gray to binary, most significant first
    int binary = 0, previous = 0;
    for (int i = 0; i < bits; ++i) {
      const int lit = patterns.picture(first + 2 * i).at<uchar>(y, x);
      EXPECT_EQ(lit + patterns.picture(first + 2 * i + 1).at<uchar>(y, x), 255);
      previous ^= lit == 255 ? 1 : 0;
      binary = 2 * binary + previous;
    }
    return binary;
  };
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 13; ++x) {
      EXPECT_EQ(value(0, column_bits, x, y), x);
      EXPECT_EQ(value(2 * column_bits, row_bits, x, y), y);
    }
  }
  EXPECT_EQ(patterns.picture(patterns.white()).at<uchar>(5, 12), 255);
  EXPECT_EQ(patterns.picture(patterns.black()).at<uchar>(5, 12), 0);
  EXPECT_EQ(patterns.white(), 14);
}

TEST(Patterns, SurviveTheirFile) {
  const auto path = test::test_folder() / "patterns.json";
  const Patterns patterns = Patterns::create("gray", 1280, 800).value();
  ASSERT_TRUE(save_patterns(patterns, path).ok());
  const auto read = load_patterns(path);
  ASSERT_TRUE(read.ok()) << read.message();
  EXPECT_EQ(*read, patterns);
}

TEST(Patterns, SayWhatIsWrong) {
  EXPECT_NE(Patterns::create("phase", 640, 480).message().find("gray"), std::string::npos);
  EXPECT_FALSE(Patterns::create("gray", 1, 480).ok());
  EXPECT_FALSE(Patterns::create("gray", 640, 100000).ok());
  const auto path = test::test_folder() / "patterns.json";
  const std::string start =
      R"({"schema": "limn.patterns/1", "code": "gray", "size": [640, 480], "pictures": )";
  ASSERT_TRUE(write_file(path, start + "41}").ok());
  EXPECT_NE(load_patterns(path).message().find("expected 40"), std::string::npos)
      << load_patterns(path).message();
  ASSERT_TRUE(write_file(path, start + R"(40, "colour": 1})").ok());
  EXPECT_NE(load_patterns(path).message().find("colour"), std::string::npos);
}

}  // namespace
}  // namespace limn::calib
