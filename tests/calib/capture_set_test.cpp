#include "calib/capture_set.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "calib/capture.h"
#include "core/file.h"
#include "core/image_io.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

CaptureSet small_plan(const fs::path& folder, int projectors = 1) {
  std::vector<CapturedDevice> devices;
  for (int i = 0; i < projectors; ++i) devices.push_back({fmt::format("projector{}", i), 16 + 8 * i, 8});
  return plan_captures(folder, {{"camera0", 20, 10}}, devices, Board::parse("charuco:5x4:25mm").value());
}

// A capture backend whose camera sees what the projector shows, as a grey level that identifies the
// projector.
CaptureBackend plain_stage(int* shown) {
  return {.show = [shown](int projector, const cv::Mat&) { return *shown = 100 + projector, Status(); },
          .grab = [shown](int) { return Result<cv::Mat>(cv::Mat(10, 20, CV_8U, cv::Scalar(*shown))); }};
}

TEST(CaptureSet, AreReadBackAsTheyWereTaken) {
  for (const int projectors : {1, 2}) {
    const fs::path folder = test::test_folder() / "captures";
    const CaptureSet plan = small_plan(folder, projectors);
    ASSERT_TRUE(begin_captures(plan).ok());
    int shown = 0, reported = 0;
    CaptureBackend backend = plain_stage(&shown);
    backend.report_progress = [&](int done, int total) { reported = total - done; };
    for (const int pose : {0, 1}) {
      const Status status = capture_pose(plan, pose, backend);
      ASSERT_TRUE(status.ok()) << status.message();
      EXPECT_EQ(reported, 0);
    }
    const auto read = load_captures(folder);
    ASSERT_TRUE(read.ok()) << read.message();
    ASSERT_EQ(read->poses.size(), 2U);
    EXPECT_EQ(read->poses[1].name, "pose01");
    EXPECT_EQ(read->board.text(), plan.board.text());
    for (int i = 0; i < projectors; ++i) {
      EXPECT_EQ(read->patterns[static_cast<size_t>(i)], plan.patterns[static_cast<size_t>(i)]);
      const auto& files = read->poses[0].images[static_cast<size_t>(i)][0];
      EXPECT_EQ(static_cast<int>(files.size()), plan.patterns[static_cast<size_t>(i)].count());
      EXPECT_EQ(read_image(files.back()).value().at<uchar>(0, 0), 100 + i);
    }
    const bool own_level = fs::exists(folder / "pose00" / "projector0" / "camera0" / "000.png");
    EXPECT_EQ(own_level, projectors == 2);
  }
}

TEST(CaptureSet, AreNeverMixedWithOlderOnes) {
  const fs::path folder = test::test_folder() / "captures";
  EXPECT_FALSE(stored_board_measured(folder).value().has_value());
  ASSERT_TRUE(begin_captures(small_plan(folder)).ok());
  EXPECT_FALSE(stored_board_measured(folder).value().has_value());
  ASSERT_TRUE(store_board_measured(folder, {0.2, 0.15, 5e-5}).ok());
  const auto stored = stored_board_measured(folder).value();
  ASSERT_TRUE(stored.has_value());
  EXPECT_NEAR(stored->width_m, 0.2, 1e-12);
  EXPECT_NEAR(stored->stddev_m, 5e-5, 1e-12);
  EXPECT_NE(begin_captures(small_plan(folder)).message().find("capture.json"), std::string::npos);
}

TEST(CaptureSet, AMissingShotIsNamedUnlessItsPoseIsSkipped) {
  const fs::path folder = test::test_folder() / "captures";
  const CaptureSet plan = small_plan(folder);
  ASSERT_TRUE(begin_captures(plan).ok());
  int shown = 0;
  for (const int pose : {0, 1}) ASSERT_TRUE(capture_pose(plan, pose, plain_stage(&shown)).ok());
  fs::remove(folder / "pose01" / "camera0" / "003.png");
  const auto broken = load_captures(folder);
  ASSERT_FALSE(broken.ok());
  EXPECT_NE(broken.message().find("pose01/camera0/003.png"), std::string::npos) << broken.message();
  const auto skipped = load_captures(folder, {"pose01"});
  ASSERT_TRUE(skipped.ok()) << skipped.message();
  EXPECT_EQ(skipped->poses.size(), 1U);
  EXPECT_NE(load_captures(folder, {"pose07"}).message().find("pose07"), std::string::npos);
}

TEST(CaptureSet, OfDifferentRigsAreNotMixed) {
  for (const int projectors : {1, 2}) {
    const fs::path folder = test::test_folder() / "captures";
    const CaptureSet plan = small_plan(folder, projectors);
    ASSERT_TRUE(begin_captures(plan).ok());
    int shown = 0;
    for (const int pose : {0, 1}) ASSERT_TRUE(capture_pose(plan, pose, plain_stage(&shown)).ok());
    const auto with = [&](const fs::path& stranger) {
      EXPECT_TRUE(make_folder(stranger).ok());
      const auto read = load_captures(folder);
      EXPECT_TRUE(load_captures(folder, {"pose01"}).ok());
      fs::remove_all(stranger);
      return read.ok() ? std::string() : read.message();
    };
    const fs::path level = projectors == 1 ? folder / "pose01" : folder / "pose01" / "projector1";
    EXPECT_NE(with(level / "camera1").find("found 'camera1'"), std::string::npos);
    EXPECT_NE(with(folder / "pose01" / "projector7").find("found 'projector7'"), std::string::npos);
    EXPECT_EQ(with(folder / "pose01" / ".thumbnails"), "") << "hidden folders are ignored";
    EXPECT_EQ(with(folder / "notes"), "") << "folders beside the poses are ignored, too";
    fs::copy(level / "camera0" / "000.png", level / "camera0" / image_name(plan.patterns.back().count()));
    const auto surplus = load_captures(folder);
    ASSERT_FALSE(surplus.ok());
    EXPECT_NE(surplus.message().find("pose01"), std::string::npos) << surplus.message();
    EXPECT_NE(surplus.message().find("found more"), std::string::npos) << surplus.message();
  }
}

TEST(CaptureSet, SayWhatIsWrongWithTheirFile) {
  const fs::path folder = test::test_folder() / "captures";
  EXPECT_NE(load_captures(folder).message().find("capture.json"), std::string::npos);
  const CaptureSet plan = small_plan(folder);
  ASSERT_TRUE(begin_captures(plan).ok());
  const std::string good = read_file(folder / "capture.json").value();
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    EXPECT_TRUE(write_file(folder / "capture.json", text).ok());
    const auto read = load_captures(folder);
    EXPECT_FALSE(read.ok());
    return read.ok() ? std::string() : read.message();
  };
  EXPECT_NE(with("\"board\"", "\"bord\"").find("bord"), std::string::npos);
  EXPECT_NE(with("charuco:5x4:25mm", "charuco:5x4:25").find("25mm"), std::string::npos);
  EXPECT_NE(with("\"camera0\"", "\"../camera0\"").find("slash"), std::string::npos);
  EXPECT_NE(with("limn.capture/1", "limn.capture/9").find("limn.capture/9"), std::string::npos);
  EXPECT_NE(with("16", "\"wide\"").find("size"), std::string::npos);
  EXPECT_NE(with("16", "32").find("projectors[0].size"), std::string::npos);
  for (const char* patterns : {"[]", "\"\"", "\"/dev/zero\"", "\"other.json\""})
    EXPECT_NE(with("\"patterns.json\"", patterns).find("capture.json: patterns: expected"), std::string::npos)
        << patterns;
  EXPECT_NE(with("[", " [").find("pose*"), std::string::npos)
      << "the only problem is that there are no poses yet";
}

TEST(CaptureSet, AFailingCameraAndAnotherModeAreErrors) {
  const fs::path folder = test::test_folder() / "captures";
  const CaptureSet plan = small_plan(folder);
  ASSERT_TRUE(begin_captures(plan).ok());
  int shown = 0;
  CaptureBackend backend = plain_stage(&shown);
  backend.grab = [](int) { return Result<cv::Mat>(cv::Mat(10, 21, CV_8U, cv::Scalar(0))); };
  EXPECT_NE(capture_pose(plan, 0, backend).message().find("21x10"), std::string::npos);
  backend.grab = [](int) { return Result<cv::Mat>(error("unplugged")); };
  EXPECT_EQ(capture_pose(plan, 0, backend).message(), "unplugged");
}

TEST(CaptureSet, ImportTakesForeignNames) {
  const fs::path folder = test::test_folder() / "photos";
  const Patterns patterns = Patterns::create(PatternCode::gray, 4, 4).value();
  for (const char* pose : {"capture_2", "capture_10", "other"}) {
    ASSERT_TRUE(make_folder(folder / pose).ok());
    for (int i = 0; i < 10; ++i) {
      cv::Mat seen;
      cv::resize(patterns.image(i), seen, {90, 60}, 0, 0, cv::INTER_NEAREST);
      ASSERT_TRUE(write_png(folder / pose / fmt::format("gray_{}.png", i), 20 + 0.7 * seen).ok());
    }
  }
  ForeignCaptureSet foreign{folder,       4, 4, Board::parse("chessboard:9x7:75mm").value(), "capture_*",
                            "gray_*.png", {}};
  const auto read = import_opencv_gray(foreign);
  ASSERT_TRUE(read.ok()) << read.message();
  ASSERT_EQ(read->poses.size(), 2U);
  EXPECT_EQ(read->poses[0].name, "capture_2");  // sorted as numbers
  EXPECT_EQ(read->poses[1].images[0][0][9].filename(), "gray_9.png");
  EXPECT_EQ(read->cameras[0].width, 90);
  fs::remove(folder / "capture_10" / "gray_9.png");
  EXPECT_NE(import_opencv_gray(foreign).message().find("expected 10 images"), std::string::npos);
  foreign.poses = "nothing*";
  EXPECT_NE(import_opencv_gray(foreign).message().find("nothing*"), std::string::npos);
}

}  // namespace
}  // namespace limn::calib
