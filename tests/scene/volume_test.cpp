// Volumes from NIfTI and DICOM files that tests/support/volume_files.h writes byte by byte. Positions are
// checked in mm of the patient against the formulas of both standards.
#include "scene/volumes/volume.h"

#include <gmock/gmock.h>
#include <zlib.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "core/file.h"
#include "scene/volumes/volume_name.h"
#include "tests/support/matchers.h"
#include "tests/support/volume_files.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;
using test::DicomFile;
using test::NiftiFile;
using ::testing::HasSubstr;

constexpr double k_near_mm = 1e-4;  // the files hold single precision

// Where a voxel is, in mm of RAS.
Eigen::Vector3d ras_mm(const Volume& volume, double i, double j, double k) {
  return 1e3 * (volume.part_from_voxel * Eigen::Vector3d(i, j, k));
}

float value_at(const Volume& volume, int i, int j, int k) {
  return volume.values[static_cast<std::size_t>(i + volume.size[0] * (j + volume.size[1] * k))];
}

// The test's folder, which is emptied once.
const fs::path& own_folder() {
  static std::string test;
  static fs::path folder;
  const std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
  if (name != test) folder = test::test_folder();
  test = name;
  return folder;
}

fs::path written(const std::string& name, const std::string& bytes) {
  const fs::path path = own_folder() / name;
  fs::create_directories(path.parent_path());
  EXPECT_TRUE(write_file(path, bytes));
  return path;
}

// A volume of 2 x 3 x 4 voxels with values 100 k + 10 j + i.
NiftiFile numbered(bool is_big_endian = false) {
  NiftiFile file;
  file.is_big_endian = is_big_endian;
  file.dim = {3, 2, 3, 4, 1, 1, 1, 1};
  for (int k = 0; k < 4; ++k)
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 2; ++i) file.add_value(static_cast<std::int16_t>(100 * k + 10 * j + i));
  return file;
}

std::string packed(const std::string& bytes) {
  const fs::path path = own_folder() / "packed.tmp";
  gzFile_s* const file = gzopen(path.c_str(), "wb");
  gzwrite(file, bytes.data(), static_cast<unsigned>(bytes.size()));
  gzclose(file);
  return read_file(path).value();
}

std::string nifti_error(const NiftiFile& file) {
  const auto volume = load_volume(written("bad.nii", file.bytes()));
  EXPECT_FALSE(volume);
  return volume ? "" : volume.message();
}

TEST(Nifti, VoxelsLieWhereTheSformSays) {
  NiftiFile file = numbered();
  file.srow = {{{-0.5F, 0.1F, 0, 90}, {0.2F, 2, 0, -126}, {0, 0.3F, 3, -72}}};
  const auto volume = load_volume(written("head.nii", file.bytes()));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_THAT(volume->size, ::testing::ElementsAre(2, 3, 4));
  EXPECT_LT((ras_mm(*volume, 0, 0, 0) - Eigen::Vector3d(90, -126, -72)).norm(), k_near_mm);
  EXPECT_LT((ras_mm(*volume, 1, 2, 3) - Eigen::Vector3d(89.7, -121.8, -62.4)).norm(), k_near_mm);
  EXPECT_EQ(value_at(*volume, 1, 2, 3), 321);
  EXPECT_EQ(value_at(*volume, 1, 0, 2), 201);
  EXPECT_EQ(volume->least, 0);
  EXPECT_EQ(volume->most, 321);
  EXPECT_TRUE(volume->warnings.empty());
}

TEST(Nifti, TheQformsQuaternionAndQfacPlaceVoxels) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()));
  for (const double qfac : {1.0, -1.0}) {
    NiftiFile file = numbered();
    file.sform_code = 0;
    file.qform_code = 1;
    file.pixdim = {static_cast<float>(qfac), 0.5F, 1.5F, 2.5F, 0, 0, 0, 0};
    file.quatern = {
        static_cast<float>(turn.x()), static_cast<float>(turn.y()), static_cast<float>(turn.z()), 10, 20, 30};
    const auto volume = load_volume(written("q.nii", file.bytes()));
    ASSERT_TRUE(volume) << volume.message();
    const Eigen::Vector3d expected =
        turn * Eigen::Vector3d(0.5 * 1, 1.5 * 2, qfac * 2.5 * 3) + Eigen::Vector3d(10, 20, 30);
    EXPECT_LT((ras_mm(*volume, 1, 2, 3) - expected).norm(), k_near_mm) << qfac;
  }
}

TEST(Nifti, UnitsOrderOfBytesCompressionAndRescaleAreFollowed) {
  NiftiFile file = numbered(true);
  file.units = 3;  // microns
  file.slope = 0.5F;
  file.intercept = -1000;
  file.cal_min = -900;
  file.cal_max = -700;
  file.srow = {{{100, 0, 0, 0}, {0, 100, 0, 0}, {0, 0, 100, 5000}}};
  const auto volume = load_volume(written("small.nii.gz", packed(file.bytes())));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_LT((ras_mm(*volume, 1, 2, 3) - Eigen::Vector3d(0.1, 0.2, 5.3)).norm(), k_near_mm);
  EXPECT_EQ(value_at(*volume, 1, 2, 3), -1000 + 0.5F * 321);
  EXPECT_EQ(volume->window.level, -800);
  EXPECT_EQ(volume->window.width, 200);
  file.units = 1;  // metres
  file.srow = {{{0.001F, 0, 0, 0}, {0, 0.001F, 0, 0}, {0, 0, 0.001F, 0}}};
  const auto metres = load_volume(written("m.nii", file.bytes()));
  ASSERT_TRUE(metres) << metres.message();
  EXPECT_LT((ras_mm(*metres, 1, 2, 3) - Eigen::Vector3d(1, 2, 3)).norm(), k_near_mm);
}

TEST(Nifti, WhatIsShownOtherwiseIsAWarning) {
  NiftiFile file = numbered();
  file.dim = {4, 2, 3, 2, 2, 1, 1, 1};
  file.units = 0;
  file.sform_code = 0;
  file.pixdim = {1, 2, 2, 2, 1, 0, 0, 0};
  const auto volume = load_volume(written("moments.nii", file.bytes()));
  ASSERT_TRUE(volume) << volume.message();
  ASSERT_EQ(volume->warnings.size(), 3U);
  EXPECT_THAT(volume->warnings[0], HasSubstr("mm"));
  EXPECT_THAT(volume->warnings[1], HasSubstr("orientation"));
  EXPECT_THAT(volume->warnings[2], HasSubstr("2 volumes"));
  EXPECT_EQ(volume->voxel_count(), 12U);
  EXPECT_EQ(volume->most, 121);
  EXPECT_LT((ras_mm(*volume, 1, 1, 1) - Eigen::Vector3d(2, 2, 2)).norm(), k_near_mm);
}

TEST(Nifti, CountsThatOverflowDoNotMatterBeyondTheFirstVolume) {
  NiftiFile file = numbered();
  file.dim = {7, 2, 3, 4, 32000, 32000, 32000, 32000};
  const auto volume = load_volume(written("many.nii", file.bytes()));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_EQ(volume->most, 321);
}

TEST(Nifti, AWindowThatTheFileDoesNotStateIsAroundMostValues) {
  NiftiFile file;
  file.dim = {3, 20, 20, 20, 1, 1, 1, 1};
  for (int i = 0; i < 8000; ++i) file.add_value(static_cast<std::int16_t>(i == 77 ? 32000 : i % 1000));
  const auto volume = load_volume(written("bright.nii", file.bytes()));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_EQ(volume->most, 32000);
  EXPECT_NEAR(volume->window.level, 499.5, 2);
  EXPECT_NEAR(volume->window.width, 980, 2);
}

TEST(Nifti, DamagedAndForeignFilesAreOneMessageEach) {
  ::testing::internal::CaptureStderr();
  NiftiFile file = numbered();
  file.values.resize(20);
  EXPECT_THAT(nifti_error(file), HasSubstr("ends before"));
  std::string late = numbered().bytes();
  numbered().put(&late, 108, 1e9F);
  EXPECT_THAT(load_volume(written("late.nii", late)).message(), HasSubstr("within the first 64 MiB"));
  const std::string whole = packed(numbered().bytes());
  EXPECT_FALSE(load_volume(written("cut.nii.gz", whole.substr(0, whole.size() - 30))));
  EXPECT_THAT(load_volume(written("short.nii", "hello")).message(), HasSubstr("ends within its header"));
  file = numbered();
  file.magic = "abc";
  EXPECT_THAT(nifti_error(file), HasSubstr("another format"));
  file = numbered();
  file.datatype = 128;
  file.bits = 24;
  EXPECT_THAT(nifti_error(file), HasSubstr("RGB"));
  file = numbered();
  file.dim = {2, 2, 12, 1, 1, 1, 1, 1};
  EXPECT_THAT(nifti_error(file), HasSubstr("single slice"));
  file.dim = {3, 2000, 2000, 2000, 1, 1, 1, 1};
  EXPECT_THAT(nifti_error(file), HasSubstr("8000 million"));
  file.dim = {3, 32000, 2, 2, 1, 1, 1, 1};
  EXPECT_THAT(nifti_error(file), HasSubstr("2048"));
  file.dim = {3, -2, 3, 4, 1, 1, 1, 1};
  EXPECT_THAT(nifti_error(file), HasSubstr("-2 along axis 1"));
  file.dim = {9, 2, 3, 4, 1, 1, 1, 1};
  EXPECT_THAT(nifti_error(file), HasSubstr("found 9"));
  EXPECT_THAT(load_volume(own_folder() / "none.nii").message(), HasSubstr("nothing"));
  EXPECT_THAT(load_volume(written("photo.png", "x")).message(), HasSubstr("another file"));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "") << "the library must not print its own words";
}

TEST(Nifti, AGridWithoutVolumeIsAnError) {
  NiftiFile file = numbered();
  file.srow[2] = {1, 1, 0, 0};
  EXPECT_THAT(nifti_error(file), HasSubstr("x 0 mm"));
  file.srow[2] = {1, 1, 0, 0};
  file.srow[1] = {0, 1, 1, 0};
  file.srow[0] = {1, 0, -1, 0};
  EXPECT_THAT(nifti_error(file), HasSubstr("one plane"));
  file.srow[1][1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(nifti_error(file).empty());
  file.srow = {{{5000, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
  EXPECT_THAT(nifti_error(file), HasSubstr("spacing and unit"));
  file = numbered();
  file.slope = 1e38F;
  file.intercept = 3e38F;
  EXPECT_THAT(nifti_error(file), HasSubstr("after rescaling"));
}

// ---- DICOM

// A slice whose values are 100 k + 10 j + i, at `position`.
DicomFile slice(int k, const std::string& position) {
  DicomFile file;
  file.columns = 4;
  file.rows = 3;
  file.position = position;
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 4; ++i) file.add_value(100 * k + 10 * j + i);
  return file;
}

// Axial slices every 2 mm.
DicomFile axial(int k) { return slice(k, "10\\20\\" + std::to_string(2 * k)); }

fs::path folder_of(const std::vector<DicomFile>& files, const std::string& name = "series") {
  const fs::path folder = own_folder() / name;
  fs::remove_all(folder);
  for (std::size_t i = 0; i < files.size(); ++i)
    written(name + "/IM" + std::to_string((7 * i) % 10) + std::to_string(i), files[i].bytes());
  return folder;
}

std::string dicom_error(const std::vector<DicomFile>& files) {
  const auto volume = load_volume(folder_of(files));
  EXPECT_FALSE(volume);
  return volume ? "" : volume.message();
}

TEST(Dicom, SlicesLieInTheirOrderWhereTheStandardSays) {
  // Coronal slices that lean by 0.3 rad, from front to back in the files, with different spacings.
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()).toRotationMatrix();
  const Eigen::Vector3d d_column = turn * Eigen::Vector3d::UnitX(), d_row = turn * -Eigen::Vector3d::UnitZ(),
                        d_normal = d_column.cross(d_row);
  const auto text = [](const Eigen::Vector3d& v) {
    return fmt::format("{:.7f}\\{:.7f}\\{:.7f}", v.x(), v.y(), v.z());
  };
  std::vector<DicomFile> files;
  for (int n = 0; n < 5; ++n) {
    const int k = (3 * n) % 5;
    files.push_back(slice(k, text(Eigen::Vector3d(-50, 60, 70) + 1.5 * k * d_normal)));
    files.back().orientation = text(d_column) + "\\" + text(d_row);
    files.back().spacing = "0.75\\0.5";  // between rows, between columns
    files.back().slope = "2";
    files.back().intercept = "-1024";
    files.back().window_centre = "40";
    files.back().window_width = "400";
  }
  const auto volume = load_volume(folder_of(files));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_THAT(volume->size, ::testing::ElementsAre(4, 3, 5));
  const Eigen::Vector3d lps =
      Eigen::Vector3d(-50, 60, 70) + 3 * 0.5 * d_column + 2 * 0.75 * d_row + 4 * 1.5 * d_normal;
  EXPECT_LT((ras_mm(*volume, 3, 2, 4) - Eigen::Vector3d(-lps.x(), -lps.y(), lps.z())).norm(), k_near_mm);
  EXPECT_EQ(value_at(*volume, 3, 2, 4), 2 * 423 - 1024);
  EXPECT_EQ(value_at(*volume, 1, 0, 2), 2 * 201 - 1024);
  EXPECT_EQ(volume->window.level, 40);
  EXPECT_EQ(volume->window.width, 400);
}

TEST(Dicom, ATiltedGantryIsPlacedAsItIs) {
  std::vector<DicomFile> files;
  for (int k = 0; k < 4; ++k) files.push_back(slice(k, fmt::format("0\\{}\\{}", 0.5 * k, 2 * k)));
  const auto volume = load_volume(folder_of(files));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_LT((ras_mm(*volume, 3, 0, 3) - Eigen::Vector3d(-3, -1.5, 6)).norm(), k_near_mm);
}

TEST(Dicom, SignedPackedShiftedAndImplicitValuesAreRead) {
  std::vector<DicomFile> files;
  for (int k = 0; k < 2; ++k) {
    DicomFile file = slice(0, "0\\0\\" + std::to_string(k));
    file.pixels.clear();
    file.is_signed = true;
    file.is_explicit = false;
    file.stored = 12;
    file.high = 13;
    for (int i = 0; i < 12; ++i)
      file.add_value((i - 6) * 4 | 0x3);  // two low bits do not belong to the value
    files.push_back(file);
  }
  const auto volume = load_volume(folder_of(files));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_EQ(value_at(*volume, 0, 0, 1), -6);
  EXPECT_EQ(value_at(*volume, 3, 2, 1), 5);
  for (const bool is_explicit : {true, false}) {
    for (DicomFile& file : files) {
      file.pixels.clear();
      file.is_signed = false;
      file.is_explicit = is_explicit;
      file.allocated = file.stored = 8;
      file.high = 7;
      for (int i = 0; i < 12; ++i) file.add_value(200 + i);
    }
    const auto bytes = load_volume(folder_of(files));
    ASSERT_TRUE(bytes) << is_explicit << bytes.message();
    EXPECT_EQ(value_at(*bytes, 0, 0, 0), 200);
    EXPECT_EQ(value_at(*bytes, 3, 2, 1), 211);
  }
}

// A slice's values as DICOM's RLE: two segments, high bytes first, as literal runs.
std::string rle(const std::string& pixels) {
  std::string high, low;
  for (std::size_t i = 0; i < pixels.size(); i += 2) {
    low += pixels[i];
    high += pixels[i + 1];
  }
  const auto segment = [](const std::string& bytes) {
    std::string out = static_cast<char>(bytes.size() - 1) + bytes;
    return out.size() % 2 == 1 ? out + '\0' : out;
  };
  const std::string first = segment(high);
  std::string head = DicomFile::number32(2) + DicomFile::number32(64) +
                     DicomFile::number32(static_cast<std::uint32_t>(64 + first.size()));
  head.resize(64);
  return head + first + segment(low);
}

TEST(Dicom, SlicesInRleAreDecoded) {
  std::vector<DicomFile> files;
  for (int k = 0; k < 3; ++k) {
    files.push_back(axial(k));
    files.back().transfer_syntax = "1.2.840.10008.1.2.5";
    files.back().pixels = rle(files.back().pixels);
    files.back().is_encoded = true;
  }
  const auto volume = load_volume(folder_of(files));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_EQ(value_at(*volume, 3, 2, 2), 223);
  for (DicomFile& file : files) file.transfer_syntax = "1.2.840.10008.1.2.4.90";  // JPEG 2000
  EXPECT_THAT(dicom_error(files), HasSubstr("JPEG 2000"));
}

// A slice's values of 16 bits as lossless JPEG (ITU-T T.81, annex H): each is predicted by the one before it.
std::string lossless_jpeg(const std::vector<int>& values, int columns, int rows) {
  const auto number = [](int n) {
    return std::string{static_cast<char>(n >> 8), static_cast<char>(n & 0xff)};
  };
  std::string out = "\xff\xd8\xff\xc3" + number(11) + '\x10' + number(rows) + number(columns) +
                    std::string("\x01\x01\x11\x00", 4);
  // 17 codes of 5 bits, for the number of bits of a difference.
  out += "\xff\xc4" + number(2 + 17 + 17) + std::string("\0\0\0\0\0\x11", 6) + std::string(11, '\0');
  for (int i = 0; i <= 16; ++i) out += static_cast<char>(i);
  out += "\xff\xda" + number(8) + std::string("\x01\x01\x00\x01\x00\x00", 6);
  std::uint32_t word = 0;
  int used = 0;
  const auto add_bits = [&](int value, int count) {
    for (int i = count - 1; i >= 0; --i) {
      word = word << 1 | (static_cast<std::uint32_t>(value) >> i & 1U);
      if (++used < 8) continue;
      out += static_cast<char>(word & 0xff);
      if ((word & 0xff) == 0xff) out += '\0';
      used = 0;
    }
  };
  for (int i = 0; i < columns * rows; ++i) {
    const int before =
        i == 0 ? 32768 : values[static_cast<std::size_t>(i % columns == 0 ? i - columns : i - 1)];
    const int difference = values[static_cast<std::size_t>(i)] - before;
    int bits = 0;
    while (std::abs(difference) >> bits != 0) ++bits;
    add_bits(bits, 5);
    if (bits < 16) add_bits(difference < 0 ? difference - 1 : difference, bits);  // 16: it is 32768
  }
  while (used != 0) add_bits(1, 1);
  return out + "\xff\xd9";
}

std::vector<int> numbered_values(int k) {
  std::vector<int> values;
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 4; ++i) values.push_back(1000 * k + 10 * j + i);
  return values;
}

TEST(Dicom, SlicesInLosslessJpegAreDecoded) {
  std::vector<DicomFile> files;
  for (int k = 0; k < 3; ++k) {
    files.push_back(axial(k));
    files.back().transfer_syntax = "1.2.840.10008.1.2.4.70";
    files.back().pixels = lossless_jpeg(numbered_values(k), 4, 3);
    files.back().is_encoded = true;
  }
  const auto volume = load_volume(folder_of(files));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_EQ(value_at(*volume, 0, 0, 0), 0);
  EXPECT_EQ(value_at(*volume, 3, 2, 2), 2023);
  EXPECT_EQ(value_at(*volume, 0, 1, 1), 1010);
}

TEST(Dicom, SlicesInBaselineJpegAreDecoded) {
  std::vector<DicomFile> files;
  cv::Mat1b image(24, 32);
  for (int j = 0; j < image.rows; ++j)
    for (int i = 0; i < image.cols; ++i) image(j, i) = static_cast<std::uint8_t>(3 * i + 5 * j);
  std::vector<std::uint8_t> jpeg;
  ASSERT_TRUE(cv::imencode(".jpg", image, jpeg, {cv::IMWRITE_JPEG_QUALITY, 98}));
  for (int k = 0; k < 2; ++k) {
    files.push_back(axial(k));
    DicomFile& file = files.back();
    file.columns = image.cols;
    file.rows = image.rows;
    file.allocated = file.stored = 8;
    file.high = 7;
    file.transfer_syntax = "1.2.840.10008.1.2.4.50";
    file.pixels.assign(jpeg.begin(), jpeg.end());
    file.is_encoded = true;
  }
  const auto volume = load_volume(folder_of(files));
  ASSERT_TRUE(volume) << volume.message();
  double worst = 0;
  for (int j = 0; j < image.rows; ++j)
    for (int i = 0; i < image.cols; ++i)
      worst = std::max(worst, std::abs(value_at(*volume, i, j, 1) - static_cast<double>(image(j, i))));
  EXPECT_LE(worst, 3);
}

TEST(Dicom, AJpegImageOfAnotherSizeThanItsSliceIsAnError) {
  std::vector<DicomFile> files = {axial(0), axial(1)};
  for (DicomFile& file : files) {
    file.transfer_syntax = "1.2.840.10008.1.2.4.70";
    file.pixels = lossless_jpeg(numbered_values(1), 4, 3);
    file.pixels.replace(7, 4, "\xff\xdc\xff\xdc");  // 65500 x 65500: 8 GiB in a decoder
    file.is_encoded = true;
  }
  EXPECT_THAT(dicom_error(files), HasSubstr("JPEG image of 4 x 3 grey values, found 65500 x 65500"));
  for (DicomFile& file : files) file.pixels.resize(5);
  EXPECT_THAT(dicom_error(files), HasSubstr("JPEG image of 4 x 3 grey values, found another"));
}

// An enhanced file of four coronal frames in the order 2, 0, 3, 1.
DicomFile enhanced() {
  DicomFile file = slice(0, "");
  file.pixels.clear();
  for (const int k : {2, 0, 3, 1}) {
    file.frame_positions.push_back(fmt::format("-5\\{}\\7", 1.5 * k));
    for (const int value : numbered_values(k)) file.add_value(value);
  }
  file.orientation = "1\\0\\0\\0\\0\\-1";
  file.spacing = "0.75\\0.5";
  file.slope = "2";
  file.intercept = "-10";
  file.window_centre = "40";
  file.window_width = "400";
  return file;
}

void expect_enhanced(const std::vector<DicomFile>& files) {
  const auto volume = load_volume(folder_of(files));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_THAT(volume->size, ::testing::ElementsAre(4, 3, 4));
  for (int k = 0; k < 4; ++k) EXPECT_EQ(value_at(*volume, 3, 2, k), 2 * (1000 * k + 23) - 10) << k;
  // LPS (-5 + 0.5 i, 1.5 k, 7 - 0.75 j)
  EXPECT_LT((ras_mm(*volume, 3, 2, 2) - Eigen::Vector3d(3.5, -3, 5.5)).norm(), k_near_mm);
  EXPECT_EQ(volume->window.level, 40);
  EXPECT_EQ(volume->window.width, 400);
}

TEST(Dicom, FramesOfAnEnhancedFileLieInTheirOrder) {
  for (const bool is_explicit : {true, false}) {
    DicomFile file = enhanced();
    file.is_explicit = is_explicit;
    expect_enhanced({file});
  }
  DicomFile packed = enhanced();
  packed.transfer_syntax = "1.2.840.10008.1.2.4.70";
  packed.is_encoded = true;
  for (const int k : {2, 0, 3, 1}) packed.fragments.push_back(lossless_jpeg(numbered_values(k), 4, 3));
  expect_enhanced({packed});
}

TEST(Dicom, EnhancedFilesThatDoNotFitAreErrors) {
  DicomFile file = enhanced();
  file.frame_positions[1] = file.frame_positions[0];
  EXPECT_THAT(dicom_error({file}), HasSubstr("(frame 1) and IM00 (frame 2) at the same"));
  file = enhanced();
  file.frame_positions[3] = "";
  EXPECT_THAT(dicom_error({file}), HasSubstr("frame 4: expected a slice with its place"));
  file = enhanced();
  file.pixels.resize(80);
  EXPECT_THAT(dicom_error({file}), HasSubstr("expected 12 values for each slice, found fewer"));
  file.frame_positions.assign(2049, "0\\0\\0");
  EXPECT_THAT(dicom_error({file}), HasSubstr("at most 2048 slices in a file, found 2049"));
}

TEST(Dicom, FilesThatWouldFillTheMemoryAreErrors) {
  DicomFile file = axial(1);
  file.transfer_syntax = "1.2.840.10008.1.2.1.99";
  EXPECT_THAT(dicom_error({axial(0), file}), HasSubstr("deflated"));
  file = axial(1);
  // Sequences within sequences, which the library reads by functions that call themselves.
  const std::string open = std::string("\x40\x00\x30\xa7SQ\0\0", 8) + DicomFile::number32(0xffffffff) +
                           std::string("\xfe\xff\x00\xe0", 4) + DicomFile::number32(0xffffffff);
  std::string nested;
  for (int i = 0; i < 300000; ++i) nested += open;
  const fs::path folder = folder_of({axial(0)});
  written("series/nested", file.bytes() + nested);
  EXPECT_THAT(load_volume(folder).message(), HasSubstr("nested: expected a complete DICOM file"));
  // Empty elements, each of which costs the library some hundred bytes.
  std::string many;
  for (int i = 0; i < 2200000; ++i) many += std::string("\x09\x00\x01\x10UN\0\0\0\0\0\0", 12);
  written("series/nested", file.bytes() + many);
  EXPECT_THAT(load_volume(folder).message(), HasSubstr("nested: expected a complete DICOM file"));
}

TEST(Dicom, MixedSeriesAreListedWithTheirSlices) {
  std::vector<DicomFile> files;
  for (int k = 0; k < 5; ++k) files.push_back(axial(k));
  for (int k = 0; k < 2; ++k) {
    files.push_back(axial(k));
    files.back().series = "1.2.3.9";
    files.back().number = "6";
    files.back().description = "localiser";
  }
  const std::string message = dicom_error(files);
  EXPECT_THAT(message, HasSubstr("2 series: 5 'head' (5 slices), 6 'localiser' (2 slices)"));
  EXPECT_THAT(message, HasSubstr("folder of its own"));
}

TEST(Dicom, MissingDoubledAndUnevenSlicesAreErrors) {
  std::vector<DicomFile> files;
  for (const int k : {0, 1, 2, 5, 6, 7}) files.push_back(axial(k));
  EXPECT_THAT(dicom_error(files), HasSubstr("2 missing"));
  files = {axial(0), axial(1), axial(1), axial(2)};
  EXPECT_THAT(dicom_error(files), HasSubstr("Several moments"));
  files = {axial(0), axial(1), axial(2), slice(3, "10\\20\\6.8"), slice(4, "10\\20\\8.8")};
  EXPECT_THAT(dicom_error(files), HasSubstr("mm beside its place"));
  files = {axial(0), slice(1, "14\\20\\2"), axial(2)};
  EXPECT_THAT(dicom_error(files), HasSubstr("mm beside its place"));
}

TEST(Dicom, SlicesThatDoNotFitAreErrors) {
  DicomFile other = axial(1);
  other.columns = 3;
  other.rows = 4;
  EXPECT_THAT(dicom_error({axial(0), other, axial(2)}), HasSubstr("another size"));
  other = axial(1);
  other.orientation = "0\\1\\0\\-1\\0\\0";
  EXPECT_THAT(dicom_error({axial(0), other}), HasSubstr("another orientation"));
  other = axial(1);
  other.spacing = "2\\2";
  EXPECT_THAT(dicom_error({axial(0), other}), HasSubstr("another spacing"));
  other = axial(1);
  other.position.clear();
  EXPECT_THAT(dicom_error({axial(0), other}), HasSubstr("ImagePositionPatient"));
  other = axial(1);
  other.orientation = "1\\0\\0\\1\\0\\0";
  EXPECT_THAT(dicom_error({axial(0), other}), HasSubstr("perpendicular"));
  other = axial(1);
  other.photometric = "RGB";
  EXPECT_THAT(dicom_error({axial(0), other}), HasSubstr("'RGB'"));
  other = axial(1);
  other.frames = "12";
  EXPECT_THAT(dicom_error({axial(0), other}), HasSubstr("place of each of its 12 frames"));
  EXPECT_THAT(dicom_error({axial(0)}), HasSubstr("single slice"));
}

TEST(Dicom, DamagedFilesAndFoldersAreOneMessageEach) {
  ::testing::internal::CaptureStderr();
  const fs::path folder = folder_of({axial(0), axial(1)});
  const std::string whole = axial(2).bytes();
  written("series/cut", whole.substr(0, whole.size() - 5));
  const auto cut = load_volume(folder);
  ASSERT_FALSE(cut);
  EXPECT_THAT(cut.message(), HasSubstr("cut"));
  written("series/cut", whole.substr(0, 300));
  EXPECT_FALSE(load_volume(folder));
  fs::create_directories(own_folder() / "empty");
  EXPECT_THAT(load_volume(own_folder() / "empty").message(), HasSubstr("found none in it"));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "") << "the library must not print its own words";
}

TEST(Dicom, OtherFilesBesideTheSlicesAreAWarning) {
  const fs::path folder = folder_of({axial(0), axial(1), axial(2)});
  written("series/readme.txt", "from the hospital");
  written("series/.hidden", "x");
  const auto volume = load_volume(folder);
  ASSERT_TRUE(volume) << volume.message();
  ASSERT_EQ(volume->warnings.size(), 1U);
  EXPECT_THAT(volume->warnings[0], HasSubstr("1 files"));
  EXPECT_TRUE(is_dicom_folder(folder));
  EXPECT_FALSE(is_dicom_folder(own_folder()));
}

TEST(Volume, NamesOfFilesAreRecognised) {
  EXPECT_TRUE(is_volume_name("a/Head.NII.GZ"));
  EXPECT_TRUE(is_volume_name("head.nii"));
  EXPECT_FALSE(is_volume_name("head.gz"));
  EXPECT_EQ(volume_stem("a/head.nii.gz"), "head");
  EXPECT_EQ(volume_stem("a/head.v2.nii"), "head.v2");
  EXPECT_EQ(volume_stem("a/series.1"), "series.1");
}

TEST(Volume, ScalingMovesVoxels) {
  const auto volume = load_volume(written("head.nii", numbered().bytes()));
  ASSERT_TRUE(volume) << volume.message();
  EXPECT_LT((ras_mm(scaled(*volume, 100), 1, 2, 3) - Eigen::Vector3d(100, 200, 300)).norm(), 100 * k_near_mm);
}

}  // namespace
}  // namespace limn::scene
