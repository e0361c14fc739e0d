#include "device/key_source.h"

#include <gtest/gtest.h>

#include "tests/support/clicker.h"
#include "tests/support/matchers.h"

namespace limn::device {
namespace {

TEST(KeySource, TellsKeysThatAreGoneDown) {
  const auto path = test::test_folder() / "clicker";
  const test::Clicker clicker(path);
  auto source = KeySource::open({"clicker", path});
  ASSERT_TRUE(source) << source.message();
  EXPECT_EQ(source->poll_pressed_keys().value(), std::vector<int>{});
  clicker.send(EV_KEY, KEY_PAGEDOWN, 1);
  clicker.send(EV_SYN, SYN_REPORT, 0);
  clicker.send(EV_KEY, KEY_PAGEDOWN, 2);
  clicker.send(EV_KEY, KEY_PAGEDOWN, 0);
  clicker.send(EV_KEY, KEY_B, 1);
  clicker.send(EV_KEY, KEY_VOLUMEUP, 1);
  EXPECT_EQ(source->poll_pressed_keys().value(), (std::vector<int>{267, 'B'}));
  EXPECT_EQ(source->poll_pressed_keys().value(), std::vector<int>{});
}

TEST(KeySource, SaysWhenItsDeviceIsGone) {
  const auto path = test::test_folder() / "clicker";
  const auto missing = KeySource::open({"clicker", path});
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.message().find("clicker: expected an input device"), std::string::npos)
      << missing.message();
  const test::Clicker clicker(path);
  auto source = KeySource::open({"clicker", path});
  ASSERT_TRUE(source) << source.message();
  clicker.send_half();
  EXPECT_NE(source->poll_pressed_keys().message().find("Plug it in again"), std::string::npos);
  EXPECT_FALSE(source->poll_pressed_keys()) << "it is not tried again immediately";
}

}  // namespace
}  // namespace limn::device
