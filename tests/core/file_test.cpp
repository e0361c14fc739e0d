#include "core/file.h"

#include <gtest/gtest.h>

#include <iterator>

#include "tests/support/matchers.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

std::ptrdiff_t entries_of(const fs::path& folder) {
  return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
}

// Writes two files into a folder together.
Status write_two(const fs::path& folder, const std::string& first, const std::string& second) {
  return write_together(folder, [&](const fs::path& into) -> Status {
    LIMN_TRY_STATUS(write_file(into / "a", first));
    if (second == "fails") return error("{}: expected to write here.", (into / "b").string());
    return write_file(into / "b", second);
  });
}

TEST(WriteTogether, ReplacesAllFilesAndLeavesOthers) {
  const fs::path folder = test::test_folder() / "rig";
  ASSERT_TRUE(write_two(folder, "1", "2"));
  ASSERT_TRUE(write_file(folder / "notes", "mine"));
  ASSERT_TRUE(write_two(folder, "3", "4"));
  EXPECT_EQ(read_file(folder / "a").value() + read_file(folder / "b").value(), "34");
  EXPECT_EQ(read_file(folder / "notes").value(), "mine");
  EXPECT_EQ(entries_of(folder), 3);
}

TEST(WriteTogether, ChangesNothingWhenOneCannotBeWritten) {
  const fs::path folder = test::test_folder() / "rig";
  ASSERT_TRUE(write_two(folder, "1", "2"));
  const Status failed = write_two(folder, "3", "fails");
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.message().find((folder / "b").string() + ": expected"), 0u) << failed.message();
  EXPECT_EQ(read_file(folder / "a").value() + read_file(folder / "b").value(), "12");
  EXPECT_EQ(entries_of(folder), 2);
}

TEST(WriteTogether, ChangesNothingWhenOneCannotBeReplaced) {
  const fs::path folder = test::test_folder() / "rig";
  fs::create_directories(folder / "b" / "inside");
  ASSERT_TRUE(write_file(folder / "a", "1"));
  const Status failed = write_two(folder, "3", "4");
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.message().find((folder / "b").string() + ": expected"), 0u) << failed.message();
  EXPECT_EQ(read_file(folder / "a").value(), "1");
  EXPECT_TRUE(fs::is_directory(folder / "b" / "inside"));
  EXPECT_EQ(entries_of(folder), 2);
}

}  // namespace
}  // namespace limn
