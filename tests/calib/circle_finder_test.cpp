#include "calib/board/circle_finder.h"

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/observations.h"
#include "tests/calib/photographed_board.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

Imager camera_with(std::vector<double> values) {
  return {"camera0", 640, 480, Lens::create("LENSMODEL_OPENCV4", std::move(values)).value(), Pose()};
}

const Imager k_camera = camera_with({700, 700, 322, 238, -0.25, 0.08, 0.001, -0.002});

// Root mean square distance of the centres from the images of the true ones.
double error_px(const Board& board, const Pose& camera_from_board, const std::vector<BoardCorner>& found) {
  double squared = 0;
  for (const BoardCorner& corner : found)
    squared += (*k_camera.project(camera_from_board * board.p_corner(corner.id)) - corner.px).squaredNorm();
  return std::sqrt(squared / static_cast<double>(found.size()));
}

// Few large circles, steep boards and a lens that bends: the centroids are up to half a pixel off the
// centres.
TEST(CircleFinder, CentresAreFreeOfThePerspectiveAndTheLens) {
  auto rng = test::test_rng();
  for (const char* text : {"circles:7x5:40mm", "acircles:4x9:25mm"}) {
    const Board board = Board::parse(text).value();
    double worst = 0, worst_plain = 0;
    for (const int index : {1, 5}) {
      const Pose camera_from_board = test::tilted_board(board, index, 0.5);
      const cv::Mat photo = test::photographed_board(board, k_camera, camera_from_board, 0, &rng, 6);
      const auto found = find_board(board, photo);
      ASSERT_EQ(static_cast<int>(found.size()), board.corner_count()) << text << " " << index;
      worst = std::max(worst, error_px(board, camera_from_board, found));
      std::vector<cv::Point2f> plain;
      const int kind = board.is_shifted() ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID;
      if (!cv::findCirclesGrid(photo, {board.columns - 1, board.rows - 1}, plain, kind)) continue;
      double squared = 0;
      for (const BoardCorner& corner : found) {
        const auto& at = plain[static_cast<size_t>(corner.id)];
        squared +=
            (Eigen::Vector2d(at.x, at.y) - *k_camera.project(camera_from_board * board.p_corner(corner.id)))
                .squaredNorm();
      }
      worst_plain = std::max(worst_plain, std::sqrt(squared / static_cast<double>(found.size())));
    }
    printf("[ circles  ] %s: %.4f px; OpenCV's centres %.4f px\n", text, worst, worst_plain);
    EXPECT_LT(worst, 0.03) << text;
  }
}

TEST(CircleFinder, StatesTheNoiseOfItsCentres) {
  auto rng = test::test_rng();
  const Board board = Board::parse("circles:9x6:25mm").value();
  double squared = 0;
  int count = 0;
  for (int index = 0; index < 4; ++index) {
    const Pose camera_from_board = test::tilted_board(board, index, 0.5);
    const auto found =
        find_board(board, test::photographed_board(board, k_camera, camera_from_board, 4, &rng));
    ASSERT_EQ(found.size(), 54U);
    for (const BoardCorner& corner : found) {
      const Eigen::Vector2d truth = *k_camera.project(camera_from_board * board.p_corner(corner.id));
      squared += (corner.px - truth).squaredNorm() / (2 * corner.stddev_px * corner.stddev_px);
      ++count;
    }
  }
  const double ratio = std::sqrt(squared / count);
  EXPECT_GT(ratio, 0.5);
  EXPECT_LT(ratio, 1.6);
}

TEST(CircleFinder, ReadsGridsInTheBoardsOrderHoweverTheyLie) {
  auto rng = test::test_rng();
  const Board board = Board::parse("acircles:4x11:20mm").value();
  EXPECT_FALSE(board.is_ambiguous());
  for (const double angle : {0.0, 1.5, 3.1, 4.6}) {
    const Pose camera_from_board =
        Pose(exp_rotation({0, 0, angle}), Eigen::Vector3d::Zero()) * test::tilted_board(board, 2, 0.6);
    const auto found =
        find_board(board, test::photographed_board(board, k_camera, camera_from_board, 1, &rng));
    ASSERT_EQ(found.size(), 44U) << angle;
    EXPECT_LT(error_px(board, camera_from_board, found), 0.1) << angle;
  }
}

TEST(CircleFinder, GivesNothingWhereThereIsNoGrid) {
  auto rng = test::test_rng();
  const Board board = Board::parse("circles:9x6:25mm").value();
  const Board other = Board::parse("chessboard:9x6:25mm").value();
  EXPECT_TRUE(
      find_board(board, test::photographed_board(other, k_camera, test::tilted_board(other, 1, 0.5), 1, &rng))
          .empty());
  EXPECT_TRUE(find_board(board, cv::Mat(480, 640, CV_8U, cv::Scalar(90))).empty());
}

TEST(CircleBoards, AreWrittenAsTheyAreRead) {
  for (const char* text : {"circles:11x7:20mm", "acircles:4x11:20mm"})
    EXPECT_EQ(Board::parse(text).value().text(), text);
  const Board shifted = Board::parse("acircles:4x11:20mm").value();
  EXPECT_EQ(shifted.corner_count(), 44);
  // OpenCV's asymmetric grid: circle (row, column) at ((2 column + row % 2), row) spacings.
  EXPECT_TRUE(shifted.p_corner(5).isApprox(shifted.p_corner(0) + Eigen::Vector3d(0.06, 0.02, 0)));
  EXPECT_TRUE(Board::parse("circles:11x7:20mm").value().is_ambiguous());
}

// Every pixel of the board has its own projector pixel: matches are the mean of a patch's pixels on both
// sides.
TEST(CircleBoards, GiveMatchesBetweenTheirCircles) {
  for (const char* text : {"circles:9x6:25mm", "acircles:4x9:25mm"}) {
    auto rng = test::test_rng();
    const Board board = Board::parse(text).value();
    const cv::Mat photo =
        test::photographed_board(board, k_camera, test::tilted_board(board, 1, 0.5), 0, &rng);
    Decoded decoded;
    decoded.px_projector = cv::Mat(photo.size(), CV_32FC2);
    decoded.variance = cv::Mat(photo.size(), CV_32FC2, cv::Scalar(0.01, 0.01));
    decoded.contrast = photo.clone();
    for (int y = 0; y < photo.rows; ++y) {
      for (int x = 0; x < photo.cols; ++x)
        decoded.px_projector.at<cv::Vec2f>(y, x) = {static_cast<float>(x) / 2 + 7, static_cast<float>(y) / 3};
    }
    const auto matches = matches_on_board(board, find_board(board, photo), decoded);
    EXPECT_GT(matches.size(), 60U) << text;
    for (const Match& match : matches) {
      EXPECT_NEAR(match.px_projector.x(), match.px_camera.x() / 2 + 7, 0.01);
      EXPECT_NEAR(match.px_projector.y(), match.px_camera.y() / 3, 0.01);
    }
  }
}

}  // namespace
}  // namespace limn::calib
