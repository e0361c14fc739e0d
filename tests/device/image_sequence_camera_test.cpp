#include "device/image_sequence_camera.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

using namespace test;
namespace fs = std::filesystem;

cv::Mat flat(int value, int width = 8) { return {6, width, CV_8U, cv::Scalar(value)}; }

TEST(ImageSequenceCamera, PlaysAFolderInTheOrderOfNamesAndEnds) {
  const fs::path folder = test_folder();
  for (const int i : {2, 0, 1}) ASSERT_TRUE(write_png(folder / fmt::format("{:03}.png", i), flat(10 * i)));
  ASSERT_TRUE(write_file(folder / "notes.txt", "no picture"));
  auto camera = device::ImageSequenceCamera::open(folder, {.name = "left", .frames_per_second = 20});
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ(camera->size(), cv::Size(8, 6));
  EXPECT_TRUE(camera->is_finite());
  EXPECT_EQ(camera->description(), "3 stored images, 8x6, 20 per second");
  for (int i = 0; i < 3; ++i) {
    const auto frame = camera->next();
    ASSERT_TRUE(frame) << frame.message();
    EXPECT_EQ(frame->camera, "left");
    EXPECT_EQ(frame->image.at<std::uint8_t>(0, 0), 10 * i);
    EXPECT_NEAR(seconds_between(Stamp{}, frame->captured_at), i / 20.0, 1e-9);
  }
  EXPECT_FALSE(camera->next());
}

TEST(ImageSequenceCamera, PlaysTiffsAndKeepsTheScaleOf12Bits) {
  const fs::path folder = test_folder();
  for (const auto& [name, level] : {std::pair{"0.tif", 3210}, {"1.TIFF", 165}}) {
    std::vector<uchar> bytes;
    cv::imencode(".tiff", cv::Mat(6, 8, CV_16U, cv::Scalar(level)), bytes);
    ASSERT_TRUE(write_file(folder / name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
  }
  auto camera = device::ImageSequenceCamera::open(folder);
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ(camera->next().value().image.at<std::uint8_t>(0, 0), 200);
  EXPECT_EQ(camera->next().value().image.at<std::uint8_t>(0, 0), 10) << "a dark image after a bright one";
}

TEST(ImageSequenceCamera, RepeatsWhenAskedTo) {
  const fs::path image = test_folder() / "one.png";
  ASSERT_TRUE(write_png(image, flat(7)));
  auto camera = device::ImageSequenceCamera::open(image, {.repeat = true});
  ASSERT_TRUE(camera);
  EXPECT_FALSE(camera->is_finite());
  const Frame first = camera->next().value(), second = camera->next().value();
  EXPECT_EQ(second.image.at<std::uint8_t>(3, 3), 7);
  EXPECT_GT(second.captured_at, first.captured_at);
}

TEST(ImageSequenceCamera, AbsentEmptyDamagedAndOddImagesAreErrorsThatNameTheFile) {
  const fs::path folder = test_folder();
  const auto absent = device::ImageSequenceCamera::open(folder / "nowhere");
  ASSERT_FALSE(absent);
  EXPECT_NE(absent.message().find("nowhere"), std::string::npos);
  EXPECT_FALSE(device::ImageSequenceCamera::open(folder));  // the folder has no image
  ASSERT_TRUE(write_file(folder / "damaged.jpg", "not a picture"));
  EXPECT_FALSE(device::ImageSequenceCamera::open(folder / "damaged.jpg"));
  fs::remove(folder / "damaged.jpg");
  ASSERT_TRUE(write_png(folder / "000.png", flat(1)));
  ASSERT_TRUE(write_png(folder / "001.png", flat(1, 9)));
  auto camera = device::ImageSequenceCamera::open(folder);
  ASSERT_TRUE(camera);
  ASSERT_TRUE(camera->next());
  for (int attempt = 0; attempt < 2; ++attempt) {  // an unreadable image is not skipped
    const auto bad = camera->next();
    ASSERT_FALSE(bad);
    EXPECT_NE(bad.message().find("001.png"), std::string::npos) << bad.message();
  }
}

}  // namespace
}  // namespace limn
