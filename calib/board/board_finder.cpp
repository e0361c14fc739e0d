#include "calib/board/board_finder.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calib/board/board_dictionary.h"
#include "calib/board/circle_finder.h"
#include "core/least_squares.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

// Share of a square along its edges; half would reach the next corner's blur.
constexpr double k_reach = 0.42;
constexpr double k_max_reach_px = 40;      // more pixels only cost time
constexpr double k_band = 0.2;             // share of a square across an edge, on boards without markers
constexpr double k_min_half_contrast = 3;  // levels; below, noise moves the fit by whole pixels
// Share of the half contrast: above it the corner is covered or has glare.
constexpr double k_max_residual = 0.35;
constexpr double k_max_shift = 0.3;    // share of a square: above it the fit has moved to another corner
constexpr double k_min_square_px = 8;  // smaller squares have too few pixels clear of the blur

// Where a corner is expected: its position and the vectors to the next corners right and down.
struct Expected {
  int id = 0;
  Vector2d px, right, down;
  bool black_up_left = true;  // whether the square between -right and -down is black
};

double erf_slope(double x) { return 2 / std::sqrt(std::numbers::pi) * std::exp(-x * x); }

struct Sample {
  double x = 0, y = 0, value = 0;
};

// Pixels along the corner's two edges, relative to `px`.
std::vector<Sample> samples_near(const cv::Mat& grey, const Expected& at, double band) {
  const double reach_right = std::min(k_reach, k_max_reach_px / at.right.norm());
  const double reach_down = std::min(k_reach, k_max_reach_px / at.down.norm());
  Eigen::Matrix2d axes;
  axes << at.right, at.down;
  const Eigen::Matrix2d to_square = axes.inverse();
  const Vector2d half = (at.right.cwiseAbs() * reach_right + at.down.cwiseAbs() * reach_down).eval();
  const int x0 = std::max(0, static_cast<int>(std::ceil(at.px.x() - half.x())));
  const int x1 = std::min(grey.cols - 1, static_cast<int>(std::floor(at.px.x() + half.x())));
  const int y0 = std::max(0, static_cast<int>(std::ceil(at.px.y() - half.y())));
  const int y1 = std::min(grey.rows - 1, static_cast<int>(std::floor(at.px.y() + half.y())));
  std::vector<Sample> samples;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const Vector2d r(x - at.px.x(), y - at.px.y());
      const Vector2d s = (to_square * r).cwiseAbs();
      const bool inside = s.x() <= reach_right && s.y() <= reach_down;
      if (inside && s.minCoeff() <= band)
        samples.push_back({r.x(), r.y(), static_cast<double>(grey.at<uchar>(y, x))});
    }
  }
  return samples;
}

// Two blurred edges that cross: value = base + slope . r + half * erf(n1 . (r - c) / s) * erf(n2 . (r - c) /
// s).
struct Junction {
  static constexpr int k_size = 9;
  using Values = Eigen::Matrix<double, k_size, 1>;  // c.x c.y angle1 angle2 s base slope.x slope.y half
  Values v;

  double predict(const Sample& p, Values* jacobian) const {
    const double dx = p.x - v[0], dy = p.y - v[1];
    const Vector2d n1(std::cos(v[2]), std::sin(v[2])), n2(std::cos(v[3]), std::sin(v[3]));
    const double u1 = (n1.x() * dx + n1.y() * dy) / v[4], u2 = (n2.x() * dx + n2.y() * dy) / v[4];
    const double e1 = std::erf(u1), e2 = std::erf(u2);
    if (jacobian) {
      const double g1 = v[8] * erf_slope(u1) * e2 / v[4], g2 = v[8] * erf_slope(u2) * e1 / v[4];
      *jacobian << -g1 * n1.x() - g2 * n2.x(), -g1 * n1.y() - g2 * n2.y(), g1 * (-n1.y() * dx + n1.x() * dy),
          g2 * (-n2.y() * dx + n2.x() * dy), -(g1 * u1 + g2 * u2), 1, p.x, p.y, e1 * e2;
    }
    return v[5] + v[6] * p.x + v[7] * p.y + v[8] * e1 * e2;
  }
};

double squared_residual(const Junction& junction, const std::vector<Sample>& samples) {
  double sum = 0;
  for (const Sample& p : samples) sum += std::pow(p.value - junction.predict(p, nullptr), 2);
  return sum;
}

struct JunctionFit {
  Junction junction;
  double residual = 0;  // standard deviation, levels
  double stddev_px = 0;
};

// Normal angle of an edge that runs along `along`, on the side of `towards`.
double normal_angle(const Vector2d& along, const Vector2d& towards) {
  Vector2d n(-along.y(), along.x());
  if (n.dot(towards) < 0) n = -n;
  return std::atan2(n.y(), n.x());
}

Junction first_guess(const std::vector<Sample>& samples, const Expected& at) {
  Junction junction;
  junction.v << 0, 0, normal_angle(at.right, at.down), normal_angle(at.down, at.right), 1.2, 0, 0, 0, 0;
  double mean = 0, product = 0, weight = 0;
  for (const Sample& p : samples) mean += p.value / static_cast<double>(samples.size());
  junction.v[8] = 1;
  for (const Sample& p : samples) {
    const double e = junction.predict(p, nullptr);
    product += e * (p.value - mean);
    weight += e * e;
  }
  junction.v[5] = mean;
  junction.v[8] = weight > 0 ? product / weight : 0;
  return junction;
}

// The samples' least squares over a junction, for minimise().
struct JunctionProblem {
  using Matrix = Eigen::Matrix<double, Junction::k_size, Junction::k_size>;
  const std::vector<Sample>& samples;
  Junction state, trial{};
  Matrix jtj{};
  Junction::Values jtr{}, step{};

  double cost() const { return squared_residual(state, samples); }
  bool linearise() {
    jtj.setZero();
    jtr.setZero();
    Junction::Values row;
    for (const Sample& p : samples) {
      const double r = p.value - state.predict(p, &row);
      jtj.selfadjointView<Eigen::Lower>().rankUpdate(row);
      jtr += row * r;
    }
    jtj = jtj.selfadjointView<Eigen::Lower>();
    return true;
  }
  bool solve(double damping) {
    Matrix raised = damped(jtj, damping);
    raised.diagonal().array() += 1e-9;
    step = raised.ldlt().solve(jtr);
    return true;
  }
  double evaluate_trial() {
    trial.v = state.v + step;
    trial.v[4] = std::clamp(trial.v[4], 0.2, 20.0);
    return trial.v.allFinite() ? squared_residual(trial, samples) : std::numeric_limits<double>::infinity();
  }
  void accept_trial() { state = trial; }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return tried.is_accepted && step.head<2>().norm() < 1e-4 && tried.gain() < 1e-6 * tried.cost_before;
  }
};

// nullopt when the place does not follow from the samples.
std::optional<JunctionFit> fit_junction(const std::vector<Sample>& samples, const Junction& start) {
  constexpr int n = Junction::k_size;
  if (samples.size() < 4 * n) return std::nullopt;
  JunctionProblem problem{.samples = samples, .state = start};
  const LeastSquaresSummary found = minimise(&problem, {.max_steps = 40,
                                                        .first_damping = 1e-3,
                                                        .least_damping = 1e-9,
                                                        .most_damping = 5e8,
                                                        .accepts_equal_cost = false});
  if (found.end == LeastSquaresEnd::no_start) return std::nullopt;
  JunctionFit fit{problem.state};
  const double variance = found.cost / static_cast<double>(samples.size() - n);
  const Eigen::Matrix<double, n, n> covariance =
      variance * problem.jtj.ldlt().solve(Eigen::Matrix<double, n, n>::Identity());
  fit.residual = std::sqrt(variance);
  fit.stddev_px = std::sqrt(covariance.topLeftCorner<2, 2>().trace() / 2);
  if (!fit.junction.v.allFinite() || !std::isfinite(fit.stddev_px)) return std::nullopt;
  return fit;
}

// Share of a square beside an edge that is clear of markers on both sides.
double clear_band(const Board& board) {
  return board.kind == BoardKind::charuco ? 0.65 * (1 - board.marker_share) / 2 : k_band;
}

std::optional<BoardCorner> refined(const Board& board, const cv::Mat& grey, Expected at) {
  const double side = std::min(at.right.norm(), at.down.norm());
  if (!(side >= k_min_square_px)) return std::nullopt;
  const Vector2d px_start = at.px;
  std::optional<JunctionFit> fit;
  for (int pass = 0; pass < 2; ++pass) {  // the second pass uses pixels around the position found
    const std::vector<Sample> samples = samples_near(grey, at, std::max(clear_band(board), 2.5 / side));
    if (samples.empty()) return std::nullopt;
    fit = fit_junction(samples, first_guess(samples, at));
    if (!fit) return std::nullopt;
    at.px += Vector2d(fit->junction.v[0], fit->junction.v[1]);
    if (!((at.px - px_start).norm() < k_max_shift * side)) return std::nullopt;
  }
  const double half = fit->junction.v[8];
  const bool sign_fits = (half < 0) == at.black_up_left;
  if (!sign_fits || std::abs(half) < k_min_half_contrast) return std::nullopt;
  if (fit->residual > k_max_residual * std::abs(half)) return std::nullopt;
  const bool seen =
      at.px.x() >= 2 && at.px.y() >= 2 && at.px.x() <= grey.cols - 3 && at.px.y() <= grey.rows - 3;
  if (!seen) return std::nullopt;
  return BoardCorner{at.id, at.px, std::hypot(fit->stddev_px, k_corner_floor_px)};
}

Vector2d to_vector(const cv::Point2f& p) { return {p.x, p.y}; }

// Vectors to the neighbours, from differences on the grid.
std::vector<Expected> expected_on_grid(const std::vector<cv::Point2f>& grid, int across, int down) {
  auto at = [&](int column, int row) { return to_vector(grid[static_cast<size_t>(row * across + column)]); };
  std::vector<Expected> expected;
  for (int row = 0; row < down; ++row) {
    for (int column = 0; column < across; ++column) {
      const int c0 = std::max(column - 1, 0), c1 = std::min(column + 1, across - 1);
      const int r0 = std::max(row - 1, 0), r1 = std::min(row + 1, down - 1);
      expected.push_back({row * across + column, at(column, row), (at(c1, row) - at(c0, row)) / (c1 - c0),
                          (at(column, r1) - at(column, r0)) / (r1 - r0), true});
    }
  }
  return expected;
}

// Whether the square up-left of the first corner is black in the image.
bool first_square_is_black(const cv::Mat& grey, const std::vector<Expected>& corners) {
  const Expected& first = corners.front();
  auto level = [&](const Vector2d& px) {
    const int x = std::clamp(static_cast<int>(std::lround(px.x())), 0, grey.cols - 1);
    const int y = std::clamp(static_cast<int>(std::lround(px.y())), 0, grey.rows - 1);
    return grey.at<uchar>(y, x);
  };
  const Vector2d a = 0.4 * first.right, b = 0.4 * first.down;
  return level(first.px - a - b) + level(first.px + a + b) <
         level(first.px + a - b) + level(first.px - a + b);
}

// Brings the grid into the board's frame, because the detector may start at any corner of the board.
std::vector<cv::Point2f> uprighted(const cv::Mat& grey, std::vector<cv::Point2f> grid, int across, int down) {
  const std::vector<Expected> corners = expected_on_grid(grid, across, down);
  const Expected& middle = corners[corners.size() / 2];
  if (middle.right.x() * middle.down.y() - middle.right.y() * middle.down.x() <
      0) {  // mirrored: turn every row
    for (int row = 0; row < down; ++row)
      std::reverse(grid.begin() + row * across, grid.begin() + (row + 1) * across);
  }
  const bool black = first_square_is_black(grey, expected_on_grid(grid, across, down));
  const bool ambiguous = (across + down) % 2 == 0;
  const bool nearer = grid.front().x + grid.front().y <= grid.back().x + grid.back().y;
  if (ambiguous ? !nearer : !black) std::reverse(grid.begin(), grid.end());
  return grid;
}

std::vector<Expected> find_chessboard(const Board& board, const cv::Mat& grey) {
  const cv::Size inner(board.columns - 1, board.rows - 1);
  std::vector<cv::Point2f> grid;
  if (!cv::findChessboardCorners(grey, inner, grid,
                                 cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE) &&
      !cv::findChessboardCornersSB(grey, inner, grid, cv::CALIB_CB_NORMALIZE_IMAGE))
    return {};
  std::vector<Expected> expected =
      expected_on_grid(uprighted(grey, grid, inner.width, inner.height), inner.width, inner.height);
  // Boards that look the same when turned are printed with either colour first.
  const bool black_first = first_square_is_black(grey, expected);
  for (Expected& at : expected)
    at.black_up_left = board.is_black(at.id % inner.width, at.id / inner.width) == black_first;
  return expected;
}

// A detected marker: its square and its corners, on the board (as Board::p_line, in units of square_m) and in
// pixels.
struct DetectedMarker {
  int column = 0, row = 0;
  std::vector<cv::Point2f> in_squares, px;
};

float line_of(const Board& board, int line) {
  return static_cast<float>(board.p_line(line) / board.square_m);
}

std::vector<DetectedMarker> find_markers(const Board& board, const cv::Mat& grey) {
  const auto [quads, ids] = find_opencv_markers(grey, dictionary_of(board).value());
  std::vector<std::pair<int, int>> squares;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      if (!board.is_black(column, row)) squares.emplace_back(column, row);
    }
  }
  std::vector<DetectedMarker> seen;
  const float low = static_cast<float>(1 - board.marker_share) / 2, high = 1 - low;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] >= static_cast<int>(squares.size())) continue;
    const auto [column, row] = squares[static_cast<size_t>(ids[i])];
    const auto x = static_cast<float>(column), y = static_cast<float>(row);
    seen.push_back({column,
                    row,
                    {{x + low, y + low}, {x + high, y + low}, {x + high, y + high}, {x + low, y + high}},
                    quads[i]});
  }
  return seen;
}

// Removes markers whose position contradicts the rest of the board (false detections in clutter).
std::vector<DetectedMarker> consistent(std::vector<DetectedMarker> markers) {
  constexpr double k_tolerance = 0.4;  // squares; lens distortion over the board stays below
  std::vector<cv::Point2f> px, in_squares;
  for (const DetectedMarker& marker : markers) {
    px.insert(px.end(), marker.px.begin(), marker.px.end());
    in_squares.insert(in_squares.end(), marker.in_squares.begin(), marker.in_squares.end());
  }
  if (markers.size() < 2) return {};
  cv::Mat good;
  if (cv::findHomography(px, in_squares, cv::RANSAC, k_tolerance, good).empty()) return {};
  std::vector<DetectedMarker> kept;
  for (size_t i = 0; i < markers.size(); ++i) {
    const int first = static_cast<int>(4 * i);
    if (cv::countNonZero(good.rowRange(first, first + 4)) == 4) kept.push_back(std::move(markers[i]));
  }
  return kept;
}

// The corners of an AprilGrid's tags in pixels, by their ids, detected in images whose white is widened so
// much that tags do not touch the squares at their corners.
std::map<int, std::vector<cv::Point2f>> find_tags(const Board& board, const cv::Mat& grey) {
  const OpencvDictionary dictionary = dictionary_of(board).value();
  std::map<int, std::vector<cv::Point2f>> found;
  for (const int widened_px : {1, 3, 5, 9}) {
    cv::Mat apart;
    cv::dilate(grey, apart, cv::Mat::ones(widened_px, widened_px, CV_8U));
    const auto [quads, ids] = find_opencv_markers(apart, dictionary, k_aprilgrid_border);
    for (size_t i = 0; i < ids.size(); ++i) found.emplace(ids[i], quads[i]);
  }
  return found;
}

// The tags on the board. Kalibr prints tag 0 at the bottom left and tags as AprilTag's library draws them,
// which is OpenCV's picture turned by 180 degrees; other programs begin at the top or use OpenCV's picture.
std::vector<DetectedMarker> placed_tags(const Board& board,
                                        const std::map<int, std::vector<cv::Point2f>>& tags,
                                        bool is_zero_at_top,
                                        bool is_turned) {
  std::vector<DetectedMarker> markers;
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column) {
      const auto id = aprilgrid_tag(board, column, is_zero_at_top ? board.rows - 1 - row : row);
      if (!id || !tags.contains(*id)) continue;
      const float left = line_of(board, column), right = line_of(board, column + 1);
      const float top = line_of(board, row), bottom = line_of(board, row + 1);
      DetectedMarker marker{
          column, row, {{left, top}, {right, top}, {right, bottom}, {left, bottom}}, tags.at(*id)};
      if (is_turned)
        std::rotate(marker.in_squares.begin(), marker.in_squares.begin() + 2, marker.in_squares.end());
      markers.push_back(std::move(marker));
    }
  return markers;
}

// The tags in the order and orientation that explain most of them.
std::vector<DetectedMarker> consistent_tags(const Board& board, const cv::Mat& grey) {
  const auto tags = find_tags(board, grey);
  std::vector<DetectedMarker> most;
  for (const bool is_zero_at_top : {false, true})
    for (const bool is_turned : {true, false}) {
      auto markers = consistent(placed_tags(board, tags, is_zero_at_top, is_turned));
      if (markers.size() > most.size()) most = std::move(markers);
    }
  return most;
}

// The corner's position by a homography of the nearest markers; nullopt without a marker in a square beside
// it.
std::optional<Expected> expected_beside(const Board& board,
                                        const std::vector<DetectedMarker>& markers,
                                        int id) {
  const int column = id % (board.columns - 1), row = id / (board.columns - 1);
  auto distance = [&](const DetectedMarker& m) {
    return std::max(std::abs(2 * (m.column - column) - 1), std::abs(2 * (m.row - row) - 1));
  };
  std::vector<cv::Point2f> px, in_squares;
  bool beside = false;
  for (const DetectedMarker& marker : markers) {
    if (distance(marker) > 3) continue;
    beside = beside || distance(marker) == 1;
    px.insert(px.end(), marker.px.begin(), marker.px.end());
    in_squares.insert(in_squares.end(), marker.in_squares.begin(), marker.in_squares.end());
  }
  if (!beside) return std::nullopt;
  const cv::Mat h = cv::findHomography(in_squares, px, 0);
  if (h.empty()) return std::nullopt;
  const float x = line_of(board, column + 1), y = line_of(board, row + 1);
  // The narrower of the squares beside the corner counts.
  const float half = board.kind == BoardKind::aprilgrid ? 0.5F * static_cast<float>(board.gap_share) : 0.5F;
  const std::vector<cv::Point2f> places = {
      {x, y}, {x + half, y}, {x - half, y}, {x, y + half}, {x, y - half}};
  std::vector<cv::Point2f> found;
  cv::perspectiveTransform(places, found, h);
  return Expected{id, to_vector(found[0]), to_vector(found[1] - found[2]), to_vector(found[3] - found[4]),
                  board.is_black(column, row)};
}

// The corners of a board with markers: ChArUco or AprilGrid.
std::vector<Expected> find_by_markers(const Board& board, const cv::Mat& grey) {
  const std::vector<DetectedMarker> markers = board.kind == BoardKind::aprilgrid
                                                  ? consistent_tags(board, grey)
                                                  : consistent(find_markers(board, grey));
  std::vector<Expected> expected;
  for (int id = 0; id < board.corner_count() && !markers.empty(); ++id) {
    if (auto at = expected_beside(board, markers, id)) expected.push_back(*at);
  }
  return expected;
}

}  // namespace

std::vector<BoardCorner> find_board(const Board& board, const cv::Mat& grey) {
  LIMN_CHECK(grey.type() == CV_8U);
  if (board.is_circles()) return find_circle_grid(board, grey);
  constexpr size_t k_least = 4;  // fewer do not determine a pose
  std::vector<BoardCorner> corners;
  for (const Expected& at :
       board.kind == BoardKind::chessboard ? find_chessboard(board, grey) : find_by_markers(board, grey)) {
    if (auto corner = refined(board, grey, at)) corners.push_back(*corner);
  }
  if (corners.size() < k_least) corners.clear();
  return corners;
}

}  // namespace limn::calib
