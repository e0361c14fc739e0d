#include "core/image_io.h"

#include <gtest/gtest.h>

#include <array>
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

// Each file of tests/core/images shows grey with red, lime, blue and white in its corners. White is
// transparent black where the file has alpha.
TEST(ImageIo, EveryKindOfFileShowsTheSameImage) {
  const std::filesystem::path folder = std::filesystem::path(LIMN_SOURCE_DIR) / "tests/core/images";
  const std::array<cv::Vec3b, 4> corners = {cv::Vec3b(0, 0, 255), {0, 255, 0}, {255, 0, 0}, {255, 255, 255}};
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const auto image = read_image(entry.path());
    ASSERT_TRUE(image) << image.message();
    ASSERT_EQ(image->type(), CV_8UC3) << entry.path();
    const int right = image->cols - 1, bottom = image->rows - 1;
    const std::array found = {image->at<cv::Vec3b>(0, 0), image->at<cv::Vec3b>(0, right),
                              image->at<cv::Vec3b>(bottom, 0), image->at<cv::Vec3b>(bottom, right)};
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_LE(cv::norm(found[i], corners[i], cv::NORM_INF), 1) << entry.path() << " corner " << i;
    const bool has_alpha = entry.path().filename().string().find("alpha") != std::string::npos;
    const auto with_alpha = read_image_with_alpha(entry.path());
    ASSERT_EQ(with_alpha->type(), has_alpha ? CV_8UC4 : CV_8UC3) << entry.path();
    if (has_alpha) {
      EXPECT_EQ(with_alpha->at<cv::Vec4b>(bottom, right)[3], 0) << entry.path();
      EXPECT_EQ(with_alpha->at<cv::Vec4b>(0, 0), cv::Vec4b(0, 0, 255, 255)) << entry.path();
      const auto ignored = read_image(entry.path(), {.alpha = Alpha::ignored});
      EXPECT_EQ(ignored->at<cv::Vec3b>(bottom, right), cv::Vec3b(0, 0, 0)) << entry.path();
    }
    ++count;
  }
  EXPECT_GE(count, 20);
}

TEST(ImageIo, LosslessFormatsComeBackExactly) {
  const std::vector<std::pair<const char*, int>> kinds = {
      {".png", CV_8UC1},  {".png", CV_8UC3},  {".bmp", CV_8UC1}, {".bmp", CV_8UC3},
      {".tiff", CV_8UC1}, {".tiff", CV_8UC3}, {".pgm", CV_8UC1}, {".ppm", CV_8UC3}};
  for (const auto& [extension, type] : kinds) {
    const cv::Mat image = noise(31, 17, type);
    const auto back = decode_image(encoded(extension, image), "noise");
    ASSERT_TRUE(back) << back.message();
    EXPECT_TRUE(test::image_near(*back, image, 0, 0, "image")) << extension;
  }
}

TEST(ImageIo, APgmIsScaledByItsMaximum) {
  for (const std::string& file :
       {std::string("P5\n# camera\n2 2\n100\n\x64\0\x32\x10", 24), std::string("P2 2 2 100 100 0 50 16")}) {
    const auto image = decode_image(file, "image");
    ASSERT_TRUE(image) << image.message();
    EXPECT_EQ(image->at<uchar>(0, 0), 255);
    EXPECT_EQ(image->at<uchar>(1, 0), 128);
    EXPECT_EQ(image->at<uchar>(1, 1), 41);
  }
  const auto deep = decode_image(std::string("P5 2 1 4095\n\x0f\xff\x08\0", 16), "image");
  ASSERT_TRUE(deep) << deep.message();
  EXPECT_EQ(deep->at<uchar>(0, 0), 255);
  EXPECT_EQ(deep->at<uchar>(0, 1), 128);
}

cv::Mat checkered_photo() {
  cv::Mat image(120, 160, CV_8UC3);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      image.at<cv::Vec3b>(y, x) = {static_cast<uchar>(x), static_cast<uchar>(y),
                                   static_cast<uchar>((x / 8 + y / 8) % 2 * 200)};
  return image;
}

std::string jpeg(bool progressive) {
  std::vector<uchar> bytes;
  cv::imencode(".jpg", checkered_photo(), bytes, {cv::IMWRITE_JPEG_PROGRESSIVE, progressive ? 1 : 0});
  return {bytes.begin(), bytes.end()};
}

TEST(ImageIo, AJpegWithoutEndMarkOrWithAnEmptyImageInFrontIsRead) {
  for (const bool progressive : {false, true}) {
    const std::string whole = jpeg(progressive);
    const cv::Mat expected = decode_image(whole, "whole").value();
    EXPECT_TRUE(test::image_near(expected, checkered_photo(), 12, 200, "whole"));
    const std::string cut = whole.substr(0, whole.size() - 2);
    for (const std::string& bytes : {cut, cut + std::string(500, '\0'), "\xff\xd8\xff\xd9" + whole,
                                     "\xff\xd8\xff\xd9\r\n" + whole, "\xff\xd8" + whole, whole + "more"}) {
      const auto image = decode_image(bytes, "image");
      ASSERT_TRUE(image) << image.message();
      EXPECT_TRUE(test::image_near(*image, expected, 0, 0, "image"));
    }
  }
}

TEST(ImageIo, AJpegThatIsCutInItsScansIsRefused) {
  for (const bool progressive : {false, true}) {
    const std::string whole = jpeg(progressive);
    for (std::size_t size = 4; size + 8 < whole.size(); size += 7)
      for (const char* end : {"", "\xff\xd9"}) {
        const auto image = decode_image(whole.substr(0, size) + end, "cut.jpg");
        // A progressive image that ends between two scans, with an end mark, is a coarser one that is
        // complete.
        if (progressive && *end != 0 && image) continue;
        ASSERT_FALSE(image) << size << " of " << whole.size() << (progressive ? " progressive" : "");
        EXPECT_NE(image.message().find("cut.jpg: expected a complete JPEG"), std::string::npos)
            << image.message();
      }
  }
}

TEST(ImageIo, AnExifOrientationIsIgnored) {
  const std::string whole = jpeg(false);
  // APP1 with one TIFF entry: orientation 6, turned by 90 degrees.
  const std::string exif(
      "\xff\xe1\0\x22"
      "Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0",
      36);
  const auto image = decode_image(whole.substr(0, 2) + exif + whole.substr(2), "turned");
  ASSERT_TRUE(image) << image.message();
  EXPECT_EQ(image->size(), cv::Size(160, 120));
}

TEST(ImageIo, CutFilesOfAllFormatsAreErrors) {
  for (const char* extension : {".png", ".bmp", ".tiff", ".ppm", ".webp"}) {
    const std::string whole = encoded(extension, noise(40, 60, CV_8UC3));
    for (const double share : {0.001, 0.1, 0.5, 0.9})
      EXPECT_FALSE(
          decode_image(whole.substr(0, static_cast<std::size_t>(share * double(whole.size()))), "cut"))
          << extension << " " << share;
  }
  const std::filesystem::path folder = std::filesystem::path(LIMN_SOURCE_DIR) / "tests/core/images";
  for (const char* name : {"palette.tga", "alpha.tga", "run_lengths.tga", "run_lengths.bmp", "cmyk.tif",
                           "tiles.tif", "text.ppm"}) {
    const std::string whole = read_file(folder / name).value();
    for (std::size_t size = 0; size < 3 * whole.size() / 4; ++size)
      EXPECT_FALSE(decode_image(whole.substr(0, size), "cut")) << name << " " << size;
  }
}

// 16-bit images of a camera: the levels of an 8-bit image at the low end of 10, 12 or 14 bits.
TEST(ImageIo, BitsAtTheLowEndAreFoundInTheImage) {
  const auto folder = test::test_folder();
  const cv::Mat image = noise(40, 60, CV_8U);
  for (const int bits : {10, 12, 14, 16}) {
    cv::Mat stored;
    const int step = 1 << (bits - 8);
    image.convertTo(stored, CV_16U, step, step / 3);
    ASSERT_TRUE(write_png(folder / "deep.png", stored));
    EXPECT_EQ(find_used_bits(folder / "deep.png").value(), bits);
    EXPECT_TRUE(test::image_near(read_grey_image(folder / "deep.png").value(), image, 0, 0, "found"));
    ASSERT_TRUE(write_file(folder / "deep.tiff", encoded(".tiff", stored)));
    EXPECT_TRUE(test::image_near(read_grey_image(folder / "deep.tiff").value(), image, 0, 0, "tiff"));
    const cv::Mat as_texture = read_image(folder / "deep.png").value();
    EXPECT_EQ(as_texture.at<uchar>(9, 9), stored.at<std::uint16_t>(9, 9) >> 8)
        << "a texture has the full range";
  }
}

TEST(ImageIo, ADarkImageOfTheFullRangeOrOfABrighterSeriesStaysDark) {
  const auto folder = test::test_folder();
  const cv::Mat dark = noise(40, 60, CV_8U) / 20;
  for (const int step : {257, 256}) {  // 8 bits as 16, 8 bits at the high end
    cv::Mat stored;
    dark.convertTo(stored, CV_16U, step);
    ASSERT_TRUE(write_png(folder / "dark.png", stored));
    EXPECT_TRUE(test::image_near(read_grey_image(folder / "dark.png").value(), dark, 0, 0, "dark"));
  }
  cv::Mat stored;
  dark.convertTo(stored, CV_16U, 16);  // 12 bits at the low end; its white has more than 1023
  ASSERT_TRUE(write_png(folder / "black.png", stored));
  EXPECT_EQ(find_used_bits(folder / "black.png").value(), 10);
  EXPECT_TRUE(test::image_near(read_grey_image(folder / "black.png", 12).value(), dark, 0, 0, "black"));
}

TEST(ImageIo, SizesBeyondReasonAreRefusedBeforeDecoding) {
  std::string png = encoded(".png", noise(2, 2, CV_8U));
  png.replace(16, 8, std::string("\0\0\x75\x30\0\0\x75\x30", 8));  // 30000 x 30000
  const std::vector<std::string> files = {
      png, "P6 30000 30000 255\n", "P5 9999999 1 255\n",
      std::string("BM\0\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\0\0\1\0\0\0\1\0\1\0\x18\0", 30) +
          std::string(24, '\0')};
  for (const std::string& file : files) {
    const auto image = decode_image(file, "bomb");
    ASSERT_FALSE(image);
    EXPECT_NE(image.message().find("expected at most"), std::string::npos) << image.message();
  }
  std::string short_jpeg = jpeg(false);
  const std::size_t frame = short_jpeg.find("\xff\xc0");
  short_jpeg.replace(frame + 5, 4, std::string("\x3f\0\x3f\0", 4));  // 16128 x 16128
  EXPECT_NE(decode_image(short_jpeg, "bomb").message().find("ends too early"), std::string::npos);
}

TEST(ImageIo, FloatingPointIsRefused) {
  const auto image = decode_image(encoded(".tiff", cv::Mat(4, 4, CV_32F, cv::Scalar(0.5))), "hdr.tiff");
  ASSERT_FALSE(image);
  EXPECT_NE(image.message().find("floating-point"), std::string::npos) << image.message();
}

TEST(ImageIo, OtherFormatsAreNamed) {
  for (const auto& [bytes, name] : {std::pair<std::string, const char*>{"GIF89a..", "a GIF"},
                                    {std::string("\0\0\0\x18"
                                                 "ftypheic",
                                                 12),
                                     "a HEIC photograph"},
                                    {"%PDF-1.7", "a PDF"},
                                    {"", "an empty file"}}) {
    const auto image = decode_image(bytes, "photo.jpg");
    ASSERT_FALSE(image);
    EXPECT_NE(image.message().find(std::string("found ") + name), std::string::npos) << image.message();
  }
}

TEST(ImageIo, ImagesAreKnownByTheirExtension) {
  for (const char* name :
       {"a.png", "a.JPG", "a.jpeg", "a.Tiff", "a.tif", "a.webp", "a.pgm", "a.BMP", "a.tga"})
    EXPECT_TRUE(is_image_name(name)) << name;
  for (const char* name : {"a.txt", "png", "a.png.bak", ".png", ""})
    EXPECT_FALSE(is_image_name(name)) << name;
  const auto folder = test::test_folder();
  EXPECT_EQ(find_image(folder / "000.png"), folder / "000.png");
  ASSERT_TRUE(write_file(folder / "000.TIF", "x"));
  EXPECT_EQ(find_image(folder / "000.png"), folder / "000.TIF");
  ASSERT_TRUE(write_file(folder / "000.png", "x"));
  EXPECT_EQ(find_image(folder / "000.png"), folder / "000.png");
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
