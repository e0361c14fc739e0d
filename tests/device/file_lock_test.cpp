#include "device/file_lock.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <optional>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"

namespace limn::device {
namespace {

TEST(FileLock, IsHeldByOneAndNamesTheHolder) {
  const auto file = test::test_folder() / "locks" / "one.lock";
  std::optional<Result<FileLock>> first = FileLock::acquire(file, "devices.json");
  ASSERT_TRUE(*first) << first->message();
  const auto second = FileLock::acquire(file, "devices.json");
  ASSERT_FALSE(second);
  test::expect_contains(second.message(), "devices.json: expected to use it alone, found that process " +
                                              std::to_string(getpid()) + " uses it. Stop that one first");
  first.reset();
  EXPECT_TRUE(FileLock::acquire(file, "devices.json"));
}

}  // namespace
}  // namespace limn::device
