#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "core/log.h"
#include "core/pose.h"
#include "core/version.h"
#include "library/convert.h"
#include "limn/error.h"
#include "limn/image.h"
#include "limn/pose.h"
#include "limn/version.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

namespace api = LIMN_VERSIONED;

#define LIMN_TEXT_(words) #words
#define LIMN_TEXT(words) LIMN_TEXT_(words)

TEST(Library, HasTheVersionOfTheBuild) {
  EXPECT_EQ(LIMN_TEXT(LIMN_VERSIONED), fmt::format("v{}_{}", LIMN_VERSION_MAJOR, LIMN_VERSION_MINOR));
  EXPECT_EQ(api::version(), version());
  EXPECT_EQ(LIMN_VERSION_TEXT, version());
  EXPECT_EQ(fmt::format("{}.{}.{}", LIMN_VERSION_MAJOR, LIMN_VERSION_MINOR, LIMN_VERSION_PATCH), version());
}

TEST(LibraryPose, IsTheRoomsToTheBit) {
  const Pose a(exp_rotation({0.3, -0.2, 1.1}), {0.1, 2, -3}), b(exp_rotation({-1, 0.5, 0.2}), {-0.4, 0, 5});
  EXPECT_TRUE(is_same(api::to_room(api::to_public(a)), a));
  EXPECT_EQ(api::to_public(a) * api::to_public(b), api::to_public(a * b));
  EXPECT_EQ(api::to_public(a).inverse(), api::to_public(a.inverse()));
}

TEST(LibraryPose, ComesBackFromItsMatrix) {
  const api::Pose pose = api::to_public(Pose(exp_rotation({0.3, -0.2, 1.1}), {0.1, 2, -3}));
  const std::array<double, 16> rows = pose.matrix();
  EXPECT_EQ(rows[3], 0.1);
  const std::array<double, 16> again = api::Pose::from_matrix(rows).matrix();
  for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_NEAR(again[i], rows[i], 1e-14);
  std::array<double, 16> scaled = rows;
  scaled[0] *= 1.01;
  EXPECT_THROW(api::Pose::from_matrix(scaled), api::Error);
}

TEST(LibraryPose, OfNoRotationIsRefused) {
  api::Pose pose;
  pose.rotation_wxyz = {0, 0, 0, 0};
  EXPECT_THROW(pose.inverse(), api::Error);
}

TEST(LibraryImage, IsReadInTheFormatThatIsAskedFor) {
  const auto file = test::test_folder() / "colours.png";
  const std::array<std::uint8_t, 6> rgb = {255, 0, 0, 10, 20, 30};
  api::write_png(file, {rgb.data(), 2, 1, 6, api::PixelFormat::rgb});
  EXPECT_EQ(api::read_image(file).pixels, std::vector<std::uint8_t>(rgb.begin(), rgb.end()));
  EXPECT_EQ(api::read_image(file, api::PixelFormat::bgr).pixels,
            (std::vector<std::uint8_t>{0, 0, 255, 30, 20, 10}));
  EXPECT_EQ(api::read_image(file, api::PixelFormat::grey).pixels.size(), 2U);
}

TEST(LibraryImage, ThatCannotBeIsRefused) {
  const auto file = test::test_folder() / "none.png";
  const std::array<std::uint8_t, 6> bytes = {};
  EXPECT_THROW(api::write_png(file, {bytes.data(), 2, 1, 5, api::PixelFormat::rgb}), api::Error);
  EXPECT_THROW(api::write_png(file, {}), api::Error);
  EXPECT_THROW(api::read_image(file), api::Error);
}

// A sink that waits for another thread that logs, as one does that needs Python's lock.
TEST(LibraryLog, MayWaitForAThreadThatLogs) {
  std::vector<std::string> lines;
  api::set_log([&](bool is_warning, const std::string& line) {
    lines.push_back(line);
    if (is_warning) std::thread([] { log_info("from another thread"); }).join();
  });
  log_warning("from the first");
  api::set_log({});
  log_warning("after it");
  EXPECT_EQ(lines, (std::vector<std::string>{"from the first", "from another thread"}));
}

}  // namespace
}  // namespace limn
