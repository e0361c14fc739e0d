#include "calib/observations.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>

#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

// A sheet seen head on. The label of each paper pixel is half its position; ink has no label, and
// paper beside ink a wrong one, as blur would give it.
struct Sheet {
  Board board;
  BoardSheet drawn = draw_board(board, {.square_px = 40});
  Decoded decoded;
  std::vector<BoardCorner> corners;

  explicit Sheet(const std::string& text = "charuco:11x8:25mm") : board(Board::parse(text).value()) {
    const cv::Mat& image = drawn.image;
    cv::Mat least;
    cv::erode(image, least, cv::Mat());
    decoded.contrast = 8 + image * (180 / 255.0);
    decoded.px_projector.create(image.size(), CV_32FC2);
    decoded.variance = cv::Mat(image.size(), CV_32FC2, cv::Scalar::all(0.01));
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const float wrong = least.at<uchar>(y, x) > 0 ? 0.0F : 0.5F;
        const float ink = image.at<uchar>(y, x) > 0 ? 0.0F : std::numeric_limits<float>::quiet_NaN();
        decoded.px_projector.at<cv::Vec2f>(y, x) = {0.5F * static_cast<float>(x) + wrong + ink,
                                                    0.5F * static_cast<float>(y) + wrong + ink};
      }
    }
    for (int id = 0; id < board.corner_count(); ++id)
      corners.push_back(
          {id, drawn.px_board_origin + drawn.pixels_per_metre * board.p_corner(id).head<2>(), 0.01});
  }
};

TEST(Observations, PaperAroundAMarkerMakesMatches) {
  const Sheet sheet;
  const std::vector<Match> matches = matches_on_board(sheet.board, sheet.corners, sheet.decoded);
  // 44 white squares of four cells, each with a marker over more than half of it.
  EXPECT_GE(matches.size(), 170U);
}

// The 71 white rectangles between tags and squares have four cells each.
TEST(Observations, PaperBetweenTheTagsOfAnAprilGridMakesMatches) {
  const Sheet sheet("aprilgrid:6x5:88mm:0.3");
  const std::vector<Match> matches = matches_on_board(sheet.board, sheet.corners, sheet.decoded);
  EXPECT_GE(matches.size(), 250U);
  for (const Match& match : matches) ASSERT_TRUE(test::near(match.px_projector, 0.5 * match.px_camera, 1e-3));
}

TEST(Observations, PaperBesideInkIsLeftOut) {
  const Sheet sheet;
  const std::vector<Match> matches = matches_on_board(sheet.board, sheet.corners, sheet.decoded);
  ASSERT_FALSE(matches.empty());
  for (const Match& match : matches) ASSERT_TRUE(test::near(match.px_projector, 0.5 * match.px_camera, 1e-4));
}

// The mean of the labels of a tilted sheet's cell is not the label at the mean of its pixels.
TEST(Observations, PerspectiveDoesNotMoveMatches) {
  Sheet sheet;
  const auto label_at = [](const Vector2d& px) {
    return Vector2d(Vector2d(0.6 * px.x() + 3, 0.5 * px.y()) / (1 + 4e-4 * px.x() - 3e-4 * px.y()));
  };
  for (int y = 0; y < sheet.decoded.px_projector.rows; ++y) {
    for (int x = 0; x < sheet.decoded.px_projector.cols; ++x) {
      auto& label = sheet.decoded.px_projector.at<cv::Vec2f>(y, x);
      const Vector2d tilted = label_at(Vector2d(x, y));
      if (!std::isnan(label[0])) label = {static_cast<float>(tilted.x()), static_cast<float>(tilted.y())};
    }
  }
  const std::vector<Match> matches = matches_on_board(sheet.board, sheet.corners, sheet.decoded);
  ASSERT_GE(matches.size(), 170U);
  Vector2d mean = Vector2d::Zero();
  for (const Match& match : matches) {
    const Vector2d off = match.px_projector - label_at(match.px_camera);
    mean += off / static_cast<double>(matches.size());
    EXPECT_LT(off.norm(), 2e-3);  // without the correction 0.01 to 0.03
  }
  EXPECT_LT(mean.norm(), 5e-4);
}

TEST(Observations, ACellWhosePaperHasFewLabelsIsNoMatch) {
  Sheet sheet;
  for (int y = 0; y < sheet.decoded.px_projector.rows; ++y) {
    for (int x = 0; x < sheet.decoded.px_projector.cols; ++x) {
      if ((x + 2 * y) % 5 < 3)
        sheet.decoded.px_projector.at<cv::Vec2f>(y, x) =
            cv::Vec2f::all(std::numeric_limits<float>::quiet_NaN());
    }
  }
  EXPECT_TRUE(matches_on_board(sheet.board, sheet.corners, sheet.decoded).empty());
}

}  // namespace
}  // namespace limn::calib
