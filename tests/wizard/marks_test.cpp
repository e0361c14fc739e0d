// The markers of captures: those of the thing, not those of the board.
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "tests/support/matchers.h"
#include "tracker/marker_image.h"
#include "wizard/measure/scale_bars.h"

namespace limn::wizard {
namespace {

void put(const cv::Mat& drawing, int x, int y, int side, cv::Mat* image) {
  cv::Mat sized;
  cv::resize(drawing, sized, {side, side}, 0, 0, cv::INTER_NEAREST);
  sized.copyTo((*image)(cv::Rect(x, y, side, side)));
}

// One pose of one camera and one projector; only its white image is read.
calib::CaptureSet captures_of(const std::filesystem::path& folder, const cv::Mat& white) {
  calib::CaptureSet set =
      calib::plan_captures(folder, {{"camera0", white.cols, white.rows}}, {{"projector0", 320, 200}},
                           calib::Board::parse("charuco:5x4:25mm").value());
  const auto count = static_cast<size_t>(set.patterns[0].count());
  const std::filesystem::path path = folder / "white.png";
  cv::imwrite(path.string(), white);
  set.poses.push_back({"pose00", {{std::vector<std::filesystem::path>(count, path)}}});
  return set;
}

TEST(Marks, TheBoardsOwnAreLeftOut) {
  cv::Mat white(600, 800, CV_8U, cv::Scalar(230));
  put(tracker::marker_image({"apriltag_36h11", "3"})->image, 60, 60, 120, &white);
  put(tracker::marker_image({"aruco_4x4_50", "2"})->image, 300, 60, 120, &white);   // on the board
  put(tracker::marker_image({"aruco_4x4_50", "40"})->image, 540, 60, 120, &white);  // not on it
  const calib::CaptureSet set = captures_of(test::test_folder(), white);
  ASSERT_EQ(set.board.dictionary, "aruco_4x4_50");
  const auto marks = marks_of(set, {"apriltag_36h11", "aruco_4x4_50"});
  ASSERT_TRUE(marks.ok()) << marks.message();
  std::set<std::string> names;
  for (const calib::DetectedMark& mark : *marks) names.insert(mark.name);
  EXPECT_EQ(names, (std::set<std::string>{"apriltag_36h11:3", "aruco_4x4_50:40"}));
  for (const calib::DetectedMark& mark : *marks) {
    const double x = mark.name == "apriltag_36h11:3" ? 60 : 540;
    EXPECT_NEAR(mark.corners_px[0].x(), x - 0.5, 0.1);
    EXPECT_NEAR(mark.corners_px[2].y(), 179.5, 0.1);
    EXPECT_EQ(mark.camera, 0);
    EXPECT_EQ(mark.pose, 0);
  }
  EXPECT_FALSE(marks_of(set, {"no_such_family"}).ok());
}

}  // namespace
}  // namespace limn::wizard
