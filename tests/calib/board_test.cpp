#include "calib/board/board.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <set>

#include "calib/board/board_finder.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;

// A photograph of the sheet: `image_from_sheet` maps sheet pixels to image pixels (pixel centres at
// integers). Exact area sampling by 8 x 8 points a pixel, then optional blur; paper 200, ink 20,
// background 90.
cv::Mat photograph(const cv::Mat& sheet, const Matrix3d& image_from_sheet, cv::Size size, double blur = 0) {
  constexpr int k_samples = 8;
  const Matrix3d back = image_from_sheet.inverse();
  cv::Mat image(size, CV_32F);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      double sum = 0;
      for (int k = 0; k < k_samples * k_samples; ++k) {
        const double dx = (k % k_samples + 0.5) / k_samples - 0.5,
                     dy = (k / k_samples + 0.5) / k_samples - 0.5;
        const Vector2d s = (back * Eigen::Vector3d(x + dx, y + dy, 1)).hnormalized();
        const int u = static_cast<int>(std::lround(s.x())), v = static_cast<int>(std::lround(s.y()));
        const bool inside = u >= 0 && v >= 0 && u < sheet.cols && v < sheet.rows;
        sum += inside ? (sheet.at<uchar>(v, u) != 0 ? 200 : 20) : 90;
      }
      image.at<float>(y, x) = static_cast<float>(sum / (k_samples * k_samples));
    }
  }
  if (blur > 0) cv::GaussianBlur(image, image, {}, blur);
  cv::Mat grey;
  image.convertTo(grey, CV_8U);
  return grey;
}

// A tilted view of the whole sheet, `width` image pixels wide, with its centre at `px_middle`.
Matrix3d tilted_view(
    const BoardSheet& sheet, double width, double angle, Vector2d px_middle, double perspective) {
  Matrix3d centre = Matrix3d::Identity(), view = Matrix3d::Identity(), place = Matrix3d::Identity();
  centre(0, 2) = -sheet.image.cols / 2.0;
  centre(1, 2) = -sheet.image.rows / 2.0;
  const double s = width / sheet.image.cols;
  view.topLeftCorner<2, 2>() << s * std::cos(angle), -0.9 * s * std::sin(angle), s * std::sin(angle),
      0.9 * s * std::cos(angle);
  view(2, 0) = perspective / sheet.image.cols;
  place.topRightCorner<2, 1>() = px_middle;
  return place * view * centre;
}

Vector2d true_px(const Board& board, const BoardSheet& sheet, const Matrix3d& view, int id) {
  const Vector2d at = sheet.px_board_origin + sheet.pixels_per_metre * board.p_corner(id).head<2>();
  return (view * at.homogeneous()).hnormalized();
}

struct Errors {
  Vector2d mean = Vector2d::Zero();
  double rms = 0, worst = 0;
  int count = 0;
};

Errors errors_of(const Board& board,
                 const BoardSheet& sheet,
                 const Matrix3d& view,
                 const std::vector<BoardCorner>& found) {
  Errors errors;
  for (const BoardCorner& corner : found) {
    const Vector2d e = corner.px - true_px(board, sheet, view, corner.id);
    errors.mean += e / static_cast<double>(found.size());
    errors.rms += e.squaredNorm() / static_cast<double>(found.size());
    errors.worst = std::max(errors.worst, e.norm());
    ++errors.count;
  }
  errors.rms = std::sqrt(errors.rms);
  return errors;
}

TEST(Board, ReadsItsTextFormsAndWritesThemBack) {
  const auto charuco = Board::parse("charuco:11x8:25mm");
  ASSERT_TRUE(charuco.ok()) << charuco.message();
  EXPECT_EQ(charuco->columns, 11);
  EXPECT_EQ(charuco->rows, 8);
  EXPECT_DOUBLE_EQ(charuco->square_m, 0.025);
  EXPECT_EQ(charuco->dictionary, "aruco_4x4_50");
  EXPECT_EQ(charuco->corner_count(), 70);
  EXPECT_EQ(charuco->text(), "charuco:11x8:25mm");
  EXPECT_FALSE(charuco->is_exact);
  for (const char* text : {"charuco:11x8:25mm:aruco_5x5_100:0.7:exact", "chessboard:9x7:75mm:exact"}) {
    EXPECT_TRUE(Board::parse(text)->is_exact) << text;
    EXPECT_EQ(Board::parse(text)->text(), text);
  }

  const auto chessboard = Board::parse("chessboard:9x7:75mm");
  ASSERT_TRUE(chessboard.ok()) << chessboard.message();
  EXPECT_EQ(chessboard->corner_count(), 63);
  EXPECT_NEAR((chessboard->p_corner(62) - Eigen::Vector3d(9 * 0.075, 7 * 0.075, 0)).norm(), 0, 1e-12);
  EXPECT_EQ(chessboard->text(), "chessboard:9x7:75mm");

  const auto own = Board::parse("charuco:20x15:1.5cm:aruco_5x5_250:0.7");
  ASSERT_TRUE(own.ok()) << own.message();
  EXPECT_EQ(own->text(), "charuco:20x15:15mm:aruco_5x5_250:0.7");
  EXPECT_EQ(Board::parse("charuco:14x10:20mm")->dictionary, "aruco_4x4_100");
}

// Kalibr's targets: aprilgrid_6x6.yaml has tagSize 0.088, tagSpacing 0.3.
TEST(Board, KnowsKalibrsAprilGrid) {
  const auto grid = Board::parse("aprilgrid:6x5:88mm:0.3");
  ASSERT_TRUE(grid.ok()) << grid.message();
  EXPECT_EQ(grid->text(), "aprilgrid:6x5:88mm:0.3");
  EXPECT_EQ(grid->corner_count(), 12 * 10);
  const double gap = 0.3 * 0.088;
  EXPECT_NEAR((grid->p_corner(0) - Eigen::Vector3d(gap, gap, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((grid->p_corner(1) - Eigen::Vector3d(gap + 0.088, gap, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((grid->p_corner(2) - Eigen::Vector3d(2 * gap + 0.088, gap, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR(grid->width_m(), 6 * 0.088 + 7 * gap, 1e-12);
  for (const char* text :
       {"aprilgrid:6x6:88mm", "aprilgrid:6x6:88mm:0", "aprilgrid:6x6:88mm:2", "aprilgrid:0x6:88mm:0.3",
        "aprilgrid:30x30:88mm:0.3", "aprilgrid:6x6:88mm:0.3:x", "aprilgrid:6x6:88:0.3"})
    EXPECT_FALSE(Board::parse(text).ok()) << text;
}

TEST(Board, SaysWhatIsWrongWithItsText) {
  for (const char* text :
       {"", "charuco", "charuco:11x8", "charuco:11x8:25", "charuco:11x8:-25mm", "charuco:11:25mm",
        "charuco:2x8:25mm", "checker:9x7:75mm", "chessboard:9x7:75mm:aruco_4x4_50",
        "charuco:11x8:25mm:aruco_9x9_50", "charuco:11x8:25mm:aruco_4x4_50:1.5", "charuco:11x8:nanmm",
        "charuco:11x8:25mm:aruco_4x4_50:nan"}) {
    const auto board = Board::parse(text);
    EXPECT_FALSE(board.ok()) << text;
  }
  EXPECT_NE(Board::parse("charuco:30x20:5mm:aruco_4x4_50").message().find("300 markers"), std::string::npos);
}

TEST(Board, DrawsItsGridOnWholePixels) {
  for (const char* text : {"charuco:11x8:25mm", "charuco:7x5:40mm:aruco_6x6_250:0.6", "chessboard:9x7:75mm",
                           "aprilgrid:6x5:88mm:0.3"}) {
    const Board board = Board::parse(text).value();
    const BoardSheet sheet = draw_board(board, {.square_px = 50});
    const double square = sheet.pixels_per_metre * board.square_m;
    EXPECT_NEAR(square, std::round(square), 1e-9) << text;
    EXPECT_NEAR(sheet.px_board_origin.x() + 0.5, std::round(sheet.px_board_origin.x() + 0.5), 1e-12);
    // Around every corner black and white alternate, right up to the corner.
    for (int id = 0; id < board.corner_count(); ++id) {
      const Vector2d px = sheet.px_board_origin + sheet.pixels_per_metre * board.p_corner(id).head<2>();
      const int x = static_cast<int>(std::lround(px.x() + 0.5)),
                y = static_cast<int>(std::lround(px.y() + 0.5));
      const int a = sheet.image.at<uchar>(y - 1, x - 1), b = sheet.image.at<uchar>(y - 1, x);
      ASSERT_EQ(a, sheet.image.at<uchar>(y, x)) << text << " corner " << id;
      ASSERT_EQ(b, sheet.image.at<uchar>(y, x - 1)) << text << " corner " << id;
      ASSERT_EQ(a + b, 255);
      const bool black = board.is_black(id % (board.columns - 1), id / (board.columns - 1));
      ASSERT_EQ(a == 0, black);
    }
  }
}

TEST(BoardFinder, FindsCharucoCornersWithoutBias) {
  const Board board = Board::parse("charuco:11x8:25mm").value();
  const BoardSheet sheet = draw_board(board, {.square_px = 160});
  for (const double width : {420.0, 700.0}) {
    const Matrix3d view = tilted_view(sheet, width, 0.35, {401.3, 297.8}, 0.15);
    const auto found = find_board(board, photograph(sheet.image, view, {800, 600}, 0.7));
    const Errors errors = errors_of(board, sheet, view, found);
    EXPECT_EQ(errors.count, board.corner_count());
    EXPECT_LT(errors.mean.norm(), 0.02) << "width " << width;
    EXPECT_LT(errors.rms, 0.03) << "width " << width;
    EXPECT_LT(errors.worst, 0.1) << "width " << width;
  }
}

TEST(BoardFinder, FindsChessboardCornersWithoutBiasWhicheverWayItIsTurned) {
  const Board board = Board::parse("chessboard:8x5:30mm").value();  // its two ends differ
  const BoardSheet sheet = draw_board(board, {.square_px = 160});
  for (const double angle : {-0.2, 1.2, 2.9, 4.4}) {
    const Matrix3d view = tilted_view(sheet, 380, angle, {300.3, 250.8}, 0.1);
    const auto found = find_board(board, photograph(sheet.image, view, {600, 500}, 0.7));
    const Errors errors = errors_of(board, sheet, view, found);
    EXPECT_EQ(errors.count, board.corner_count()) << "angle " << angle;
    EXPECT_LT(errors.mean.norm(), 0.02) << "angle " << angle;
    EXPECT_LT(errors.worst, 0.1) << "angle " << angle;
  }
}

TEST(BoardFinder, SeesACharucoBoardInPart) {
  const Board board = Board::parse("charuco:11x8:25mm").value();
  const BoardSheet sheet = draw_board(board, {.square_px = 160});
  const Matrix3d view = tilted_view(sheet, 700, 0.2, {600, 350}, 0.1);
  cv::Mat image = photograph(sheet.image, view, {640, 480}, 0.6);
  cv::rectangle(image, {350, 200, 90, 60}, cv::Scalar(128), cv::FILLED);  // a hand
  const auto found = find_board(board, image);
  const Errors errors = errors_of(board, sheet, view, found);
  EXPECT_GT(errors.count, 12);
  EXPECT_LT(errors.count, board.corner_count());
  EXPECT_LT(errors.worst, 0.15);
}

TEST(BoardFinder, TellsTheTruthAboutItsNoise) {
  const Board board = Board::parse("charuco:11x8:25mm").value();
  const BoardSheet sheet = draw_board(board, {.square_px = 160});
  const Matrix3d view = tilted_view(sheet, 500, 0.35, {401.3, 297.8}, 0.15);
  const cv::Mat clean = photograph(sheet.image, view, {800, 600}, 0.7);
  auto rng = test::test_rng();
  std::normal_distribution<double> noise(0, 12);
  double squared_pull = 0, squared_error = 0;
  int count = 0;
  for (int shot = 0; shot < 5; ++shot) {
    cv::Mat noisy = clean.clone();
    for (int i = 0; i < noisy.rows * noisy.cols; ++i)
      noisy.data[i] = cv::saturate_cast<uchar>(noisy.data[i] + noise(rng));
    for (const BoardCorner& corner : find_board(board, noisy)) {
      const Vector2d e = corner.px - true_px(board, sheet, view, corner.id);
      squared_pull += e.squaredNorm() / (2 * corner.stddev_px * corner.stddev_px);
      squared_error += e.squaredNorm() / 2;
      ++count;
    }
  }
  ASSERT_GT(count, 300);
  EXPECT_NEAR(std::sqrt(squared_pull / count), 1.0, 0.2);
  EXPECT_LT(std::sqrt(squared_error / count), 0.04);
}

TEST(BoardFinder, FindsAprilGridCornersWithoutBiasWhicheverWayItIsTurned) {
  const Board board = Board::parse("aprilgrid:6x5:88mm:0.3").value();
  const BoardSheet sheet = draw_board(board, {.square_px = 160});
  for (const double angle : {0.2, 2.0, 3.3, 4.9}) {
    const Matrix3d view = tilted_view(sheet, 560, angle, {401.3, 297.8}, 0.15);
    const auto found = find_board(board, photograph(sheet.image, view, {800, 600}, 0.7));
    const Errors errors = errors_of(board, sheet, view, found);
    EXPECT_GE(errors.count, board.corner_count() - 4) << "angle " << angle;
    EXPECT_LT(errors.mean.norm(), 0.02) << "angle " << angle;
    EXPECT_LT(errors.worst, 0.15) << "angle " << angle;
  }
}

TEST(BoardFinder, FindsAnAprilGridThatBeginsAtTheTopWithOpencvsTags) {
  const Board board = Board::parse("aprilgrid:3x2:40mm:0.25").value();
  BoardSheet sheet = draw_board(board, {.square_px = 160});
  const Matrix3d view = tilted_view(sheet, 500, 0.2, {321.3, 237.8}, 0.1);
  const auto kalibrs = find_board(board, photograph(sheet.image, view, {640, 480}, 0.7));
  // Turning every row of tags by 180 degrees, and exchanging the two rows, makes the other layout.
  const cv::Mat from = sheet.image.clone();
  const auto square = [&](const cv::Mat& image, int column, int row) {
    const auto px = [&](int line) {
      return static_cast<int>(
          std::lround(sheet.px_board_origin.x() + 0.5 + sheet.pixels_per_metre * board.p_line(line)));
    };
    return image(cv::Rect(px(2 * column + 1), px(2 * row + 1), px(2) - px(1), px(2) - px(1)));
  };
  for (int row = 0; row < 2; ++row)
    for (int column = 0; column < 3; ++column) {
      cv::Mat tag;
      cv::rotate(square(from, column, 1 - row), tag, cv::ROTATE_180);
      tag.copyTo(square(sheet.image, column, row));
    }
  const auto found = find_board(board, photograph(sheet.image, view, {640, 480}, 0.7));
  const Errors errors = errors_of(board, sheet, view, found);
  EXPECT_EQ(kalibrs.size(), 24u);
  EXPECT_EQ(errors.count, 24);
  EXPECT_LT(errors.worst, 0.15);
}

TEST(BoardFinder, FindsNothingWhereThereIsNoBoard) {
  const Board charuco = Board::parse("charuco:11x8:25mm").value();
  const Board chessboard = Board::parse("chessboard:9x7:75mm").value();
  const Board other = Board::parse("chessboard:8x6:30mm").value();
  const BoardSheet sheet = draw_board(other, {.square_px = 50});
  EXPECT_TRUE(find_board(charuco, sheet.image).empty());
  EXPECT_TRUE(find_board(chessboard, cv::Mat(480, 640, CV_8U, cv::Scalar(80))).empty());
}

}  // namespace
}  // namespace limn::calib
