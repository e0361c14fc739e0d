#include "calib/judge/board_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "calib/board/board_finder.h"
#include "calib/capture.h"
#include "core/file.h"
#include "core/image_io.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

// The board's sheet, seen slightly from the side in an image of 640 x 480.
cv::Mat view_of(const std::string& board) {
  const BoardSheet sheet = draw_board(Board::parse(board).value(), {.square_px = 32});
  const auto w = static_cast<float>(sheet.image.cols), h = static_cast<float>(sheet.image.rows);
  const std::array<cv::Point2f, 4> from = {{{0, 0}, {w, 0}, {w, h}, {0, h}}},
                                   to = {{{60, 40}, {590, 70}, {570, 430}, {40, 440}}};
  cv::Mat view;
  cv::warpPerspective(sheet.image, view, cv::getPerspectiveTransform(from.data(), to.data()), {640, 480},
                      cv::INTER_AREA, cv::BORDER_CONSTANT, cv::Scalar(90));
  cv::GaussianBlur(view, view, {3, 3}, 0.7);
  return view;
}

TEST(BoardCheck, SeesWhichBoardAnImageShows) {
  const auto charuco = identify_board(view_of("charuco:9x6:25mm:aruco_5x5_100"));
  ASSERT_TRUE(charuco);
  EXPECT_EQ(charuco->kind, BoardKind::charuco);
  EXPECT_EQ(charuco->columns, 9);
  EXPECT_EQ(charuco->rows, 6);
  EXPECT_EQ(charuco->dictionary, "aruco_5x5_50") << "the smallest that holds these markers";
  EXPECT_FALSE(charuco->white_first);
  const auto chessboard = identify_board(view_of("chessboard:9x6:25mm"));
  ASSERT_TRUE(chessboard);
  EXPECT_EQ(chessboard->kind, BoardKind::chessboard);
  EXPECT_EQ(std::max(chessboard->columns, chessboard->rows), 10);
  EXPECT_EQ(std::min(chessboard->columns, chessboard->rows), 7);
  EXPECT_FALSE(identify_board(cv::Mat(480, 640, CV_8U, cv::Scalar(90))));
}

// The message of the check for captures that are described as `described` and show `shown`.
std::string said(const std::string& described, const std::string& shown) {
  const auto folder = test::test_folder() / "captures";
  const CaptureSet plan =
      plan_captures(folder, {{"camera0", 640, 480}}, {{"projector0", 4, 4}}, Board::parse(described).value());
  EXPECT_TRUE(begin_captures(plan).ok());
  const cv::Mat view = view_of(shown);
  const CaptureBackend backend{.show = [](int, const cv::Mat&) { return Status(); },
                               .grab = [&](int) { return Result<cv::Mat>(view); }};
  EXPECT_TRUE(capture_pose(plan, 0, backend).ok());
  Observations observations;
  for (const BoardCorner& corner : find_board(plan.board, view))
    observations.corners.push_back({0, 0, corner.id, corner.px, corner.stddev_px});
  const Status status = check_board(load_captures(folder).value(), observations);
  return status.ok() ? "" : status.message();
}

TEST(BoardCheck, SaysWhatWasSeenInsteadOfTheDescribedBoard) {
  EXPECT_EQ(said("charuco:9x6:25mm", "charuco:9x6:25mm"), "");
  EXPECT_EQ(said("chessboard:9x6:25mm", "chessboard:9x6:25mm"), "");
  const std::string wider = said("charuco:11x8:25mm", "charuco:9x6:25mm");
  EXPECT_NE(wider.find("9 squares across and at least 6 down"), std::string::npos) << wider;
  EXPECT_NE(wider.find("pose00/camera0/008.png"), std::string::npos) << wider;
  EXPECT_NE(said("charuco:9x6:25mm", "charuco:9x6:25mm:aruco_6x6_50").find("markers of aruco_6x6_50"),
            std::string::npos);
  EXPECT_NE(said("charuco:9x6:25mm", "chessboard:9x6:25mm").find("a chessboard of"), std::string::npos);
  EXPECT_NE(said("chessboard:9x6:25mm", "charuco:9x6:25mm").find("a charuco board 9 squares across"),
            std::string::npos);
  EXPECT_NE(said("chessboard:11x8:25mm", "chessboard:9x6:25mm").find("a chessboard of"), std::string::npos);
}

}  // namespace
}  // namespace limn::calib
