#include "core/append_log.h"

#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/support/small_disk.h"

namespace limn {
namespace {

TEST(AppendLog, LinesWaitWhileTheDiskIsFull) {
  const auto path = test::test_folder() / "rows.csv";
  std::string all = "row\n";
  {
    auto file = AppendLog::create(path, all);
    ASSERT_TRUE(file) << file.message();
    double at_s = 0;
    const auto add = [&](const std::string& line) {
      all += line;
      file->add(line, shifted(Stamp{}, at_s += 2));
    };
    add("1\n");
    EXPECT_EQ(read_file(path).value(), all);
    {
      const test::SmallDisk full(7);  // bytes: half a line more
      add("22\n");
      EXPECT_EQ(read_file(path).value(), "row\n1\n") << "a line is whole or not there";
      const auto message = file->take_message();
      ASSERT_TRUE(message);
      EXPECT_NE(message->find("rows.csv: expected to write here"), std::string::npos) << *message;
      add("333\n");
      EXPECT_FALSE(file->take_message()) << "each message comes once";
    }
    add("4\n");
    EXPECT_EQ(read_file(path).value(), all);
    EXPECT_EQ(file->take_message(), "rows.csv can be written again.");
    add("5\n");
    file->add("6\n", shifted(Stamp{}, at_s + 0.1));
    all += "6\n";
  }
  EXPECT_EQ(read_file(path).value(), all) << "the destructor writes the last lines";
}

TEST(AppendLog, OfTooManyLinesTheNewestAreKept) {
  const auto path = test::test_folder() / "rows.csv";
  auto file = AppendLog::create(path, "row\n");
  ASSERT_TRUE(file) << file.message();
  const auto add = [&](int i) {
    file->add(fmt::format("{}{:04}\n", std::string(995, 'x'), i), shifted(Stamp{}, 2.0 * i));
  };
  {
    const test::SmallDisk full(4);
    for (int i = 0; i < 3000; ++i) add(i);
  }
  add(3000);
  const std::string kept = read_file(path).value();
  EXPECT_LT(kept.size(), (std::size_t{1} << 20) + 2000);
  EXPECT_GT(kept.size(), std::size_t{1000} * 1000);
  EXPECT_EQ(kept.substr(0, 5), "row\nx");
  EXPECT_EQ((kept.size() - 4) % 1000, 0U) << "whole lines";
  EXPECT_EQ(kept.substr(kept.size() - 5), "3000\n");
}

}  // namespace
}  // namespace limn
