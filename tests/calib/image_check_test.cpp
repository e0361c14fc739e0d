#include "calib/judge/image_check.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/core.hpp>

#include "calib/capture.h"
#include "core/file.h"
#include "core/image_io.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;
using namespace test;

// A camera of 48 x 24 pixels in front of a projector of 16 x 8: each pixel sees the light of column x / 3 and
// row y / 3, of `visible` columns only, with noise of `noise` levels.
struct Camera {
  int visible = 16;
  double noise = 1;
  bool sees_light = true;
  cv::RNG rng{7};

  cv::Mat photograph(const cv::Mat& shown) {
    cv::Mat photo(24, 48, CV_8U);
    for (int y = 0; y < photo.rows; ++y) {
      for (int x = 0; x < photo.cols; ++x) {
        const int column = x * visible / photo.cols, row = y / 3;
        const bool lit = sees_light && shown.at<uchar>(row, column) != 0;
        photo.at<uchar>(y, x) =
            cv::saturate_cast<uchar>((lit ? 180 : 30) + (noise > 0 ? rng.gaussian(noise) : 0));
      }
    }
    return photo;
  }
};

void capture(const fs::path& folder, int poses, int projectors, Camera camera) {
  std::vector<CapturedDevice> devices;
  for (int i = 0; i < projectors; ++i) devices.push_back({fmt::format("projector{}", i), 16, 8});
  const CaptureSet plan =
      plan_captures(folder, {{"camera0", 48, 24}}, devices, Board::parse("charuco:5x4:25mm").value());
  ASSERT_TRUE(begin_captures(plan).ok());
  cv::Mat photo;
  for (int pose = 0; pose < poses; ++pose) {
    const Status status = capture_pose(
        plan, pose,
        {.show = [&](int, const cv::Mat& shown) { return photo = camera.photograph(shown), Status(); },
         .grab = [&](int) { return Result<cv::Mat>(photo); }});
    ASSERT_TRUE(status.ok()) << status.message();
  }
}

// The message of the check for a folder; empty when nothing is wrong.
std::string said(const fs::path& folder) {
  const auto captures = load_captures(folder);
  EXPECT_TRUE(captures.ok()) << captures.message();
  const Status status = check_images(*captures);
  return status.ok() ? "" : status.message();
}

void copy_over(const fs::path& from, const fs::path& to) {
  fs::copy_file(from, to, fs::copy_options::overwrite_existing);
}

bool names_both(const std::string& message, const std::string& a, const std::string& b) {
  return message.find(a) != std::string::npos && message.find(b) != std::string::npos;
}

TEST(ImageCheck, IsContentWithSoundCaptures) {
  const fs::path folder = test_folder();
  capture(folder / "one", 3, 1, {});
  EXPECT_EQ(said(folder / "one"), "");
  capture(folder / "two", 2, 2, {});
  EXPECT_EQ(said(folder / "two"), "");
}

// Without noise, equal images are no copies: half of the projector invisible, all of it invisible, a dark
// room.
TEST(ImageCheck, IsContentWithEqualImagesThatTheLightExplains) {
  const fs::path folder = test_folder();
  capture(folder / "half", 1, 1, {.visible = 8, .noise = 0});
  EXPECT_EQ(said(folder / "half"), "");
  capture(folder / "unseen", 2, 2, {.noise = 0, .sees_light = false});
  EXPECT_EQ(said(folder / "unseen"), "");
}

TEST(ImageCheck, NamesBothPlacesOfACopiedImage) {
  const fs::path folder = test_folder(), series = folder / "pose01" / "camera0";
  capture(folder, 3, 1, {});
  copy_over(series / "002.png", series / "007.png");
  EXPECT_TRUE(names_both(said(folder), "pose01/camera0/007.png", "pose01/camera0/002.png")) << said(folder);
}

TEST(ImageCheck, NamesAnImageThatCameFromAnotherPose) {
  const fs::path folder = test_folder();
  capture(folder, 3, 1, {});
  copy_over(folder / "pose00" / "camera0" / "001.png", folder / "pose02" / "camera0" / "004.png");
  EXPECT_TRUE(names_both(said(folder), "pose02/camera0/004.png", "pose00/camera0/001.png")) << said(folder);
}

TEST(ImageCheck, NamesWhiteAndBlackThatAreTheSame) {
  const fs::path folder = test_folder(), series = folder / "pose00" / "camera0";
  capture(folder, 2, 1, {});
  const int count = Patterns::create(PatternCode::gray, 16, 8).value().count();
  copy_over(series / image_name(count - 2), series / image_name(count - 1));
  EXPECT_TRUE(names_both(said(folder), image_name(count - 2), image_name(count - 1))) << said(folder);
}

TEST(ImageCheck, NamesAPoseThatIsACopyOfAnother) {
  const fs::path folder = test_folder();
  capture(folder, 2, 2, {});
  fs::copy(folder / "pose00", folder / "pose02", fs::copy_options::recursive);
  EXPECT_TRUE(names_both(said(folder), "pose02/projector0/camera0", "pose00/projector0/camera0"))
      << said(folder);
  fs::remove_all(folder / "pose02");
  fs::remove_all(folder / "pose01" / "projector1");
  fs::copy(folder / "pose01" / "projector0", folder / "pose01" / "projector1", fs::copy_options::recursive);
  EXPECT_TRUE(names_both(said(folder), "pose01/projector1/camera0", "pose01/projector0/camera0"))
      << said(folder);
}

TEST(ImageCheck, NamesSizesAndTruncationEvenWhereNoBoardIsSeen) {
  const fs::path folder = test_folder(), series = folder / "pose01" / "camera0";
  capture(folder, 2, 1, {});
  const std::string whole = read_file(series / "003.png").value();
  ASSERT_TRUE(write_file(series / "003.png", whole.substr(0, whole.size() - 20)).ok());
  EXPECT_TRUE(names_both(said(folder), "pose01/camera0/003.png", "truncated")) << said(folder);
  ASSERT_TRUE(write_png(series / "003.png", cv::Mat(20, 40, CV_8U, cv::Scalar(0))).ok());
  EXPECT_TRUE(names_both(said(folder), "pose01/camera0/003.png", "40x20")) << said(folder);
  EXPECT_NE(said(folder).find("Not all images of this series"), std::string::npos);
  for (const auto& entry : fs::directory_iterator(series))
    ASSERT_TRUE(write_png(entry.path(), cv::Mat(20, 40, CV_8U, cv::Scalar(0))).ok());
  EXPECT_NE(said(folder).find("another rig"), std::string::npos) << said(folder);
}

}  // namespace
}  // namespace limn::calib
