#include "core/image_io.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/support/small_disk.h"

namespace limn {
namespace {

cv::Mat noise(int rows, int cols, int type) {
  cv::Mat image(rows, cols, type);
  cv::RNG rng(7);
  rng.fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

std::string encoded(const char* extension, const cv::Mat& image) {
  std::vector<uchar> bytes;
  cv::imencode(extension, image, bytes);
  return {bytes.begin(), bytes.end()};
}

TEST(ImageIo, PngComesBackExactly) {
  const auto path = test::test_folder() / "a.png";
  for (const int type : {CV_8UC1, CV_8UC3}) {
    const cv::Mat image = noise(31, 17, type);
    ASSERT_TRUE(write_png(path, image, {.pixels_per_metre = 4000}));
    const auto back = read_image(path);
    ASSERT_TRUE(back) << back.message();
    EXPECT_TRUE(test::image_near(*back, image, 0, 0, "png"));
  }
}

TEST(ImageIo, PngCarriesItsScale) {
  const auto path = test::test_folder() / "a.png";
  ASSERT_TRUE(write_png(path, noise(8, 8, CV_8U), {.pixels_per_metre = 4000}));
  const std::string bytes = read_file(path).value();
  const std::size_t at = bytes.find("pHYs");
  ASSERT_EQ(at, 8u + 25u + 4u);
  EXPECT_EQ(bytes.substr(at + 4, 9), std::string("\0\0\x0f\xa0\0\0\x0f\xa0\x01", 9));
}

TEST(ImageIo, TruncatedFilesAreErrors) {
  const auto folder = test::test_folder();
  for (const char* extension : {".png", ".jpg"}) {
    const std::string whole = encoded(extension, noise(200, 300, CV_8UC3));
    for (const double share : {0.001, 0.1, 0.5, 0.99}) {
      const auto path = folder / (std::string("cut") + extension);
      ASSERT_TRUE(write_file(path, whole.substr(0, static_cast<std::size_t>(share * double(whole.size())))));
      const auto read = read_image(path);
      EXPECT_FALSE(read) << extension << " " << share;
    }
  }
}

TEST(ImageIo, DamagedMissingAndForeignFilesAreErrors) {
  const auto folder = test::test_folder();
  std::string damaged = encoded(".png", noise(64, 64, CV_8U));
  damaged[damaged.size() / 2] = static_cast<char>(~damaged[damaged.size() / 2]);
  ASSERT_TRUE(write_file(folder / "damaged.png", damaged));
  EXPECT_FALSE(read_image(folder / "damaged.png"));
  EXPECT_FALSE(read_image(folder / "missing.png"));
  EXPECT_FALSE(read_image(folder));
  ASSERT_TRUE(write_file(folder / "text.png", "not a picture"));
  const auto foreign = read_image(folder / "text.png");
  ASSERT_FALSE(foreign);
  EXPECT_NE(foreign.message().find("expected a PNG, JPEG"), std::string::npos);
}

TEST(ImageIo, LargerOnesThanAnyCameraTakesAreErrors) {
  const auto path = test::test_folder() / "a.png";
  ASSERT_TRUE(write_png(path, cv::Mat(2, k_max_image_side, CV_8UC1, cv::Scalar(9))));
  EXPECT_TRUE(read_grey_image(path));
  ASSERT_TRUE(write_png(path, cv::Mat(k_max_image_side + 1, 2, CV_8UC1, cv::Scalar(9))));
  const auto image = read_grey_image(path);
  ASSERT_FALSE(image);
  EXPECT_EQ(image.message(),
            path.string() + ": expected at most 32767 pixels a side, found 2x32768. Make it smaller.");
}

TEST(ImageIo, DataUriHoldsTheJpeg) {
  const std::string uri = data_uri(noise(5, 7, CV_8UC3));
  const std::string head = "data:image/jpeg;base64,";
  ASSERT_TRUE(uri.starts_with(head));
  EXPECT_TRUE(uri.substr(head.size()).starts_with("/9j/")) << "ff d8 ff, the start of a JPEG";
  EXPECT_EQ((uri.size() - head.size()) % 4, 0u);
}

TEST(File, AMissingFolderIsToldAndWritingReplacesWhole) {
  const auto folder = test::test_folder();
  const auto status = write_file(folder / "missing" / "a.txt", "x");
  ASSERT_FALSE(status);
  EXPECT_NE(status.message().find("expected to write here"), std::string::npos) << status.message();
  ASSERT_TRUE(write_file(folder / "a.txt", "old and longer"));
  ASSERT_TRUE(write_file(folder / "a.txt", "new"));
  EXPECT_EQ(read_file(folder / "a.txt").value(), "new");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1) << "no temporary file is left";
}

TEST(File, AWriteThatFailsHalfWayKeepsTheOldFile) {
  const auto folder = test::test_folder();
  ASSERT_TRUE(write_file(folder / "a.txt", "old"));
  const Status status = [&] {
    const test::SmallDisk full(1000);
    return write_file(folder / "a.txt", std::string(5000, 'x'));
  }();
  ASSERT_FALSE(status);
  EXPECT_NE(status.message().find("a.txt"), std::string::npos) << status.message();
  EXPECT_EQ(read_file(folder / "a.txt").value(), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1) << "no temporary file is left";
}

}  // namespace
}  // namespace limn
