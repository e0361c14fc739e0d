#include "calib/board/circle_finder.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <optional>

#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr int k_rays = 48;  // directions in which a circle's edge is measured
constexpr double k_ray_step_px = 0.25;
constexpr double k_least_contrast = 12;  // levels between ink and paper
constexpr double k_rough_edge = 0.15;    // share of the radius: above it something covers the edge
constexpr int k_measurements = 3;        // each begins at the centre of the one before
constexpr int k_corrections = 4;         // passes over all centres; the shift changes little after two

// One circle of the grid, with the vectors to the next circles right and down on the board's lattice.
struct Circle {
  int id = 0;
  Vector2d px, right, down;
};

// A circle's edge as an image shows it.
struct CircleEdge {
  Vector2d px_centroid;
  double area_px2 = 0;
  double noise_px = 0;  // scatter of the edge about a smooth curve
};

// Centroid and area of a closed polygon.
CircleEdge centroid_of(const std::vector<Vector2d>& polygon) {
  CircleEdge edge{Vector2d::Zero()};
  const Vector2d origin = polygon[0];
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vector2d a = polygon[i] - origin, b = polygon[(i + 1) % polygon.size()] - origin;
    const double twice = a.x() * b.y() - a.y() * b.x();
    edge.area_px2 += twice / 2;
    edge.px_centroid += twice / 6 * (a + b);
  }
  edge.px_centroid = origin + edge.px_centroid / edge.area_px2;
  edge.area_px2 = std::abs(edge.area_px2);
  return edge;
}

double level_at(const cv::Mat& grey, const Vector2d& px) {
  const int x = static_cast<int>(std::floor(px.x())), y = static_cast<int>(std::floor(px.y()));
  if (x < 0 || y < 0 || x + 1 >= grey.cols || y + 1 >= grey.rows) return -1;
  const double u = px.x() - x, v = px.y() - y;
  const uchar *upper = grey.ptr<uchar>(y) + x, *lower = grey.ptr<uchar>(y + 1) + x;
  return (1 - v) * ((1 - u) * upper[0] + u * upper[1]) + v * ((1 - u) * lower[0] + u * lower[1]);
}

// Where a ray from the centre crosses the middle between ink and paper, as a share of `ray`; nullopt if it
// does not.
std::optional<double> crossing_on(const cv::Mat& grey, const Vector2d& centre, const Vector2d& ray) {
  const int samples = static_cast<int>(ray.norm() / k_ray_step_px);
  std::vector<double> levels;
  for (int i = 0; i <= samples; ++i) {
    levels.push_back(level_at(grey, centre + ray * i / samples));
    if (levels.back() < 0) return std::nullopt;
  }
  if (samples < 8) return std::nullopt;
  const double ink = quantile(levels, 0.1), paper = quantile(levels, 0.9), middle = (ink + paper) / 2;
  if (paper - ink < k_least_contrast || levels[0] > middle) return std::nullopt;
  for (size_t i = 1; i < levels.size(); ++i) {
    if (levels[i] < middle) continue;
    const double share = (middle - levels[i - 1]) / (levels[i] - levels[i - 1]);
    return (static_cast<double>(i) - 1 + share) / samples;
  }
  return std::nullopt;
}

// Scatter of the crossings about a curve with two waves around the circle, px.
double scatter_of(const std::vector<double>& crossings, const std::vector<Vector2d>& rays) {
  Eigen::MatrixXd waves(k_rays, 5);
  Eigen::VectorXd radii(k_rays);
  double length = 0;
  for (int k = 0; k < k_rays; ++k) {
    const double angle = 2 * std::numbers::pi * k / k_rays;
    waves.row(k) << 1, std::cos(angle), std::sin(angle), std::cos(2 * angle), std::sin(2 * angle);
    radii[k] = crossings[static_cast<size_t>(k)];
    length += rays[static_cast<size_t>(k)].norm() / k_rays;
  }
  const Eigen::VectorXd left = radii - waves * waves.colPivHouseholderQr().solve(radii);
  return length * std::sqrt(left.squaredNorm() / (k_rays - 5));
}

std::optional<CircleEdge> edge_around(const cv::Mat& grey, const Circle& circle, double reach) {
  std::vector<double> crossings;
  std::vector<Vector2d> rays, polygon;
  for (int k = 0; k < k_rays; ++k) {
    const double angle = 2 * std::numbers::pi * k / k_rays;
    rays.emplace_back(reach * (std::cos(angle) * circle.right + std::sin(angle) * circle.down));
    const auto crossing = crossing_on(grey, circle.px, rays.back());
    if (!crossing) return std::nullopt;
    crossings.push_back(*crossing);
    polygon.emplace_back(circle.px + *crossing * rays.back());
  }
  CircleEdge edge = centroid_of(polygon);
  edge.noise_px = scatter_of(crossings, rays);
  if (edge.noise_px > k_rough_edge * std::sqrt(edge.area_px2 / std::numbers::pi)) return std::nullopt;
  return edge;
}

std::optional<CircleEdge> measured_edge(const cv::Mat& grey, Circle circle, double reach) {
  std::optional<CircleEdge> edge;
  for (int pass = 0; pass < k_measurements; ++pass) {
    edge = edge_around(grey, circle, reach);
    if (!edge) return std::nullopt;
    circle.px = edge->px_centroid;
  }
  return edge;
}

// A smooth map from the board's plane to the image: a homography, then a polynomial of third degree.
class BoardMap {
 public:
  BoardMap(const Board& board, const std::vector<int>& ids, const std::vector<Vector2d>& px)
      : scale_(2 / board.width_m()) {
    std::vector<cv::Point2d> from, to;
    for (size_t i = 0; i < ids.size(); ++i) {
      const Vector2d s = place(board.p_corner(ids[i]).head<2>());
      from.emplace_back(s.x(), s.y());
      to.emplace_back(px[i].x(), px[i].y());
    }
    const cv::Mat h = cv::findHomography(from, to, 0);
    if (h.empty()) return;
    homography_ = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.ptr<double>());
    is_known_ = true;
    constexpr size_t k_least = 24;  // places for ten coefficients
    if (ids.size() < k_least) return;
    Eigen::MatrixXd terms(static_cast<Eigen::Index>(ids.size()), 10), left(terms.rows(), 2);
    for (Eigen::Index i = 0; i < terms.rows(); ++i) {
      const auto at = static_cast<size_t>(i);
      const Vector2d s = place(board.p_corner(ids[at]).head<2>());
      terms.row(i) = terms_at(s).transpose();
      left.row(i) = (px[at] - straight(s)).transpose();
    }
    bend_ = terms.colPivHouseholderQr().solve(left);
  }
  bool is_known() const { return is_known_; }
  Vector2d operator()(const Vector2d& p_board) const {
    const Vector2d s = place(p_board);
    return straight(s) + bend_.transpose() * terms_at(s);
  }

 private:
  Vector2d place(const Vector2d& p_board) const { return scale_ * p_board - Vector2d(1, 1); }
  Vector2d straight(const Vector2d& s) const { return (homography_ * s.homogeneous()).hnormalized(); }
  static Eigen::Matrix<double, 10, 1> terms_at(const Vector2d& s) {
    const double x = s.x(), y = s.y();
    Eigen::Matrix<double, 10, 1> terms;
    terms << 1, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y;
    return terms;
  }

  double scale_ = 1;
  Eigen::Matrix3d homography_ = Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 10, 2> bend_ = Eigen::Matrix<double, 10, 2>::Zero();
  bool is_known_ = false;
};

CircleEdge predicted_edge(const BoardMap& map, const Vector2d& p_centre, double radius_m) {
  std::vector<Vector2d> polygon;
  for (int k = 0; k < k_rays; ++k) {
    const double angle = 2 * std::numbers::pi * k / k_rays;
    polygon.push_back(map(p_centre + radius_m * Vector2d(std::cos(angle), std::sin(angle))));
  }
  return centroid_of(polygon);
}

// The images of the circles' centres, from the centroids of their images.
std::vector<Vector2d> centres_of(const Board& board,
                                 const std::vector<int>& ids,
                                 const std::vector<CircleEdge>& edges) {
  std::vector<Vector2d> centres;
  for (const CircleEdge& edge : edges) centres.push_back(edge.px_centroid);
  double radius_m = board.square_m / 4;
  for (int pass = 0; pass < k_corrections; ++pass) {
    const BoardMap map(board, ids, centres);
    if (!map.is_known()) break;
    std::vector<double> areas;
    for (size_t i = 0; i < ids.size(); ++i)
      areas.push_back(edges[i].area_px2 /
                      predicted_edge(map, board.p_corner(ids[i]).head<2>(), radius_m).area_px2);
    radius_m *= std::sqrt(median(std::move(areas)));
    for (size_t i = 0; i < ids.size(); ++i) {
      const Vector2d p = board.p_corner(ids[i]).head<2>();
      centres[i] = edges[i].px_centroid - (predicted_edge(map, p, radius_m).px_centroid - map(p));
    }
  }
  return centres;
}

std::vector<cv::Point2f> opencv_grid(const Board& board, const cv::Mat& grey) {
  const cv::Size size(board.columns - 1, board.rows - 1);
  cv::SimpleBlobDetector::Params params;
  params.minArea = 25;
  params.maxArea =
      std::max(5000.F, static_cast<float>(grey.total()) / static_cast<float>(board.corner_count()));
  params.minDistBetweenBlobs = 5;
  const cv::Ptr<cv::SimpleBlobDetector> detector = cv::SimpleBlobDetector::create(params);
  const int kind = board.is_shifted() ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID;
  std::vector<cv::Point2f> grid;
  try {
    if (cv::findCirclesGrid(grey, size, grid, kind, detector)) return grid;
    if (cv::findCirclesGrid(grey, size, grid, kind | cv::CALIB_CB_CLUSTERING, detector)) return grid;
  } catch (const cv::Exception&) {  // OpenCV's clustering fails on some arrangements of blobs
  }
  return {};
}

// Circles with the vectors of the board's lattice, from a homography of the grid.
std::vector<Circle> circles_of(const Board& board, const std::vector<cv::Point2f>& grid) {
  std::vector<int> ids;
  std::vector<Vector2d> px;
  for (size_t i = 0; i < grid.size(); ++i) {
    ids.push_back(static_cast<int>(i));
    px.emplace_back(grid[i].x, grid[i].y);
  }
  const BoardMap map(board, ids, px);
  std::vector<Circle> circles;
  for (size_t i = 0; i < ids.size() && map.is_known(); ++i) {
    const Vector2d p = board.p_corner(ids[i]).head<2>(), half(board.square_m / 2, board.square_m / 2);
    const Vector2d across(half.x(), 0), along(0, half.y());
    circles.push_back({ids[i], px[i], map(p + across) - map(p - across), map(p + along) - map(p - along)});
  }
  return circles;
}

bool is_mirrored(const std::vector<Circle>& circles) {
  const Circle& middle = circles[circles.size() / 2];
  return middle.right.x() * middle.down.y() - middle.right.y() * middle.down.x() < 0;
}

// The grid in the board's frame: not mirrored, and the corner nearer to the top left first where both ends
// fit.
std::vector<cv::Point2f> upright_grid(const Board& board, std::vector<cv::Point2f> grid) {
  const std::vector<Circle> circles = circles_of(board, grid);
  const int across = board.columns - 1;
  if (!circles.empty() && is_mirrored(circles)) {
    std::reverse(grid.begin(), grid.end());  // the rows from below, and each row back as it was
    for (auto row = grid.begin(); row != grid.end(); row += across) std::reverse(row, row + across);
  }
  if (board.is_ambiguous() && grid.front().x + grid.front().y > grid.back().x + grid.back().y)
    std::reverse(grid.begin(), grid.end());
  return grid;
}

}  // namespace

std::vector<BoardCorner> find_circle_grid(const Board& board, const cv::Mat& grey) {
  LIMN_CHECK(grey.type() == CV_8U);
  std::vector<cv::Point2f> grid = opencv_grid(board, grey);
  if (grid.empty()) return {};
  const double reach = board.is_shifted() ? std::numbers::sqrt2 / 2 : 0.5;  // halfway to the next circle
  std::vector<int> ids;
  std::vector<CircleEdge> edges;
  for (const Circle& circle : circles_of(board, upright_grid(board, std::move(grid)))) {
    const auto edge = measured_edge(grey, circle, reach);
    if (!edge) continue;
    ids.push_back(circle.id);
    edges.push_back(*edge);
  }
  constexpr size_t k_least = 6;
  if (ids.size() < k_least) return {};
  const std::vector<Vector2d> centres = centres_of(board, ids, edges);
  std::vector<BoardCorner> corners;
  for (size_t i = 0; i < ids.size(); ++i) {
    const double pixels = std::min<double>(k_rays, 2 * std::sqrt(std::numbers::pi * edges[i].area_px2));
    corners.push_back(
        {ids[i], centres[i], std::hypot(edges[i].noise_px * std::sqrt(2 / pixels), k_corner_floor_px)});
  }
  return corners;
}

}  // namespace limn::calib
