#include "tracker/refine.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace limn::tracker {
namespace {

// What edge lines keep however little noise there is: pixels that are not square, print, paper. From still
// markers in real pictures (.05 px between poses against .026 px jitter).
constexpr double k_systematic_px = 0.02;
// The averaged gradient's tails below this share of its peak count as flat.
constexpr double k_flat_share = 0.05;
constexpr int k_max_reach = 10;
constexpr double k_huber = 1.5;  // in robust standard deviations
constexpr int k_min_crossings = 3;

// v of the lens's bow against the chord: t (1 - t) (c0 + c1 t + c2 t^2), t from 0 to 1 along the chord.
struct Bow {
  Eigen::Vector3d c = Eigen::Vector3d::Zero();
  double u_from = 0, u_length = 1;
  double at(double u) const {
    const double t = (u - u_from) / u_length;
    return t * (1 - t) * (c[0] + t * (c[1] + t * c[2]));
  }
};

// How the picture of the straight line between two pixels bends away from their chord.
Bow bow_of(const Lens& lens, const Eigen::Vector2d& from, const Eigen::Vector2d& to, bool flat) {
  Bow bow;
  const int u = flat ? 0 : 1;
  const int v = 1 - u;
  bow.u_from = from[u];
  bow.u_length = to[u] - from[u];
  const auto d_from = lens.unproject(from);
  const auto d_to = lens.unproject(to);
  if (!d_from || !d_to) return bow;
  constexpr int k_points = 5;
  Eigen::Matrix<double, k_points, 3> rows;
  Eigen::Matrix<double, k_points, 1> bends;
  for (int i = 0; i < k_points; ++i) {
    const double s = (i + 1.0) / (k_points + 1);
    const auto px = lens.project((1 - s) * *d_from + s * *d_to);
    if (!px) return bow;
    const double t = ((*px)[u] - bow.u_from) / bow.u_length;
    const double bubble = t * (1 - t);
    rows.row(i) << bubble, bubble * t, bubble * t * t;
    bends[i] = (*px)[v] - (from[v] + t * (to[v] - from[v]));
  }
  const Eigen::Matrix3d normal = rows.transpose() * rows;
  const Eigen::Vector3d c = normal.ldlt().solve(rows.transpose() * bends);
  if (c.allFinite()) bow.c = c;
  return bow;
}

}  // namespace

// Crossings of one side. First the gradient profile averaged along the side says how wide the edge is (blur,
// thin margins), then every row's centroid is taken over that window alone.
bool EdgeRefiner::fit_side(const cv::Mat& grey,
                           const std::array<Eigen::Vector2d, 4>& corners,
                           std::size_t side,
                           double reach_px,
                           double min_contrast,
                           const Lens* lens,
                           EdgeLine* line) {
  const Eigen::Vector2d& from = corners[side];
  const Eigen::Vector2d& to = corners[(side + 1) % 4];
  const Eigen::Vector2d chord = to - from;
  line->flat = std::abs(chord.x()) >= std::abs(chord.y());
  const int u_axis = line->flat ? 0 : 1;
  const int v_axis = 1 - u_axis;
  const double u_length = chord[u_axis];
  // Clockwise, y down: the inside lies to the right of the chord.
  const int inward = (line->flat ? chord.x() : -chord.y()) > 0 ? 1 : -1;
  const double slope = chord[v_axis] / u_length;
  const int reach =
      std::clamp(static_cast<int>(std::ceil(reach_px * std::hypot(1.0, slope))), 2, k_max_reach);
  const auto profile = static_cast<std::size_t>(2 * reach);
  const Bow bow = lens ? bow_of(*lens, from, to, line->flat) : Bow{};

  const int u_limit = line->flat ? grey.cols : grey.rows;
  const int v_limit = line->flat ? grey.rows : grey.cols;
  const std::ptrdiff_t v_stride = inward * (line->flat ? static_cast<std::ptrdiff_t>(grey.step[0]) : 1);
  const double u_low = std::min(from[u_axis], to[u_axis]);
  const double u_high = std::max(from[u_axis], to[u_axis]);
  const double trim = std::clamp(0.06 * (u_high - u_low), 1.0, 4.0);
  const int first = std::max(0, static_cast<int>(std::ceil(u_low + trim)));
  const int last = std::min(u_limit - 1, static_cast<int>(std::floor(u_high - trim)));

  crossings_.clear();
  gradients_.clear();
  std::array<double, 2 * k_max_reach> mean{};
  double inside = 0;
  for (int u = first; u <= last; ++u) {
    const double v = from[v_axis] + (u - from[u_axis]) * slope + bow.at(u);
    const int centre = static_cast<int>(std::lround(v));
    if (centre - reach < 0 || centre + reach >= v_limit) continue;
    const std::uint8_t* pixel = line->flat ? grey.ptr(centre) + u : grey.ptr(u) + centre;
    for (int k = 0; k < 2 * reach; ++k) {
      const std::ptrdiff_t at = (k - reach) * v_stride;
      const double difference = static_cast<double>(pixel[at]) - static_cast<double>(pixel[at + v_stride]);
      gradients_.push_back(difference);
      mean[static_cast<std::size_t>(k)] += difference;
    }
    inside += pixel[0];
    crossings_.push_back({static_cast<double>(u), static_cast<double>(centre), 0});
  }
  if (static_cast<int>(crossings_.size()) < k_min_crossings) return false;

  // The edge's window [low, high) in the averaged profile. Nearer peaks win over slightly higher ones.
  std::size_t peak = 0;
  double best = 0;
  for (std::size_t k = 0; k < profile; ++k) {
    const double distance = std::abs(static_cast<double>(k) + 0.5 - reach);
    const double value = mean[k] / (1 + 0.15 * distance);
    if (value > best) {
      best = value;
      peak = k;
    }
  }
  const double flat_below = k_flat_share * mean[peak];
  std::size_t low = peak;
  std::size_t high = peak + 1;
  while (low > 0 && mean[low - 1] > flat_below) --low;
  while (high < profile && mean[high] > flat_below) ++high;
  double contrast = 0;
  for (std::size_t k = low; k < high; ++k) contrast += mean[k];
  contrast /= static_cast<double>(crossings_.size());
  if (contrast < min_contrast) return false;

  // Rows beside a corner see the other edge as far as the blur reaches.
  const double blur_trim = std::min(0.2 * (u_high - u_low), 0.5 * static_cast<double>(high - low) + 0.5);
  double inside_sum = 0;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < crossings_.size(); ++i) {
    const Crossing& row = crossings_[i];
    if (row.u < u_low + blur_trim || row.u > u_high - blur_trim) continue;
    const double* gradient = &gradients_[i * profile];
    double sum = 0;
    double moment = 0;
    for (std::size_t k = low; k < high; ++k) {
      sum += gradient[k];
      moment += gradient[k] * (static_cast<double>(k) + 0.5 - reach);
    }
    if (sum < 0.4 * contrast) continue;  // covered, or no edge here
    const double v = row.v + inward * moment / sum;
    const double share = sum / contrast;
    const std::uint8_t* pixel = line->flat ? grey.ptr(static_cast<int>(row.v)) + static_cast<int>(row.u)
                                           : grey.ptr(static_cast<int>(row.u)) + static_cast<int>(row.v);
    inside_sum += pixel[(static_cast<std::ptrdiff_t>(high) - reach) * v_stride];
    crossings_[kept++] = {row.u, v - bow.at(row.u), std::min(1.0, share * share)};
  }
  crossings_.resize(kept);
  if (static_cast<int>(kept) < k_min_crossings) return false;
  line->inside_level = inside_sum / static_cast<double>(kept);
  line->outside_level = line->inside_level + contrast;
  return fit_line(line);
}

// Weighted least squares, then Huber weights on the residuals' robust scale.
bool EdgeRefiner::fit_line(EdgeLine* line) {
  double u_sum = 0;
  for (const Crossing& c : crossings_) u_sum += c.u;
  line->u_middle = u_sum / static_cast<double>(crossings_.size());
  line->offset = line->slope = 0;
  double scale = 0;  // 0: no robust weights yet
  Eigen::Matrix2d inverse = Eigen::Matrix2d::Zero();
  double squares = 0;
  double weights = 0;
  for (int round = 0; round < 4; ++round) {
    double s = 0, su = 0, suu = 0, sv = 0, suv = 0;
    squares = weights = 0;
    for (const Crossing& c : crossings_) {
      const double u = c.u - line->u_middle;
      const double residual = std::abs(c.v - line->offset - line->slope * u);
      const double huber = scale > 0 && residual > k_huber * scale ? k_huber * scale / residual : 1;
      const double w = c.weight * huber;
      s += w;
      su += w * u;
      suu += w * u * u;
      sv += w * c.v;
      suv += w * u * c.v;
    }
    const double determinant = s * suu - su * su;
    if (!(determinant > 1e-9 * s * s)) return false;
    line->offset = (suu * sv - su * suv) / determinant;
    line->slope = (s * suv - su * sv) / determinant;
    inverse << suu / determinant, -su / determinant, -su / determinant, s / determinant;
    deviations_.clear();
    for (const Crossing& c : crossings_) {
      const double residual = c.v - line->offset - line->slope * (c.u - line->u_middle);
      deviations_.push_back(std::abs(residual));
      const double bounded = scale > 0 ? std::min(std::abs(residual), 3 * scale) : std::abs(residual);
      squares += c.weight * bounded * bounded;
      weights += c.weight;
    }
    const auto middle = deviations_.begin() + static_cast<std::ptrdiff_t>(deviations_.size() / 2);
    std::nth_element(deviations_.begin(), middle, deviations_.end());
    scale = std::max(1.4826 * *middle, 1e-3);
  }
  const double freedom =
      std::max(1.0, static_cast<double>(crossings_.size()) - 2) / static_cast<double>(crossings_.size());
  line->covariance = inverse * (squares / weights / freedom);
  return true;
}

namespace {

// n . p = c of an edge line, in pixels.
void implicit(const EdgeRefiner::EdgeLine& line, Eigen::Vector2d* n, double* c) {
  *n = line.flat ? Eigen::Vector2d(-line.slope, 1) : Eigen::Vector2d(1, -line.slope);
  *c = line.offset - line.slope * line.u_middle;
}

bool intersect(const EdgeRefiner::EdgeLine& a,
               const EdgeRefiner::EdgeLine& b,
               Eigen::Vector2d* corner,
               Eigen::Matrix2d* covariance) {
  Eigen::Matrix2d n;
  Eigen::Vector2d c;
  Eigen::Vector2d row;
  implicit(a, &row, &c[0]);
  n.row(0) = row.transpose();
  implicit(b, &row, &c[1]);
  n.row(1) = row.transpose();
  const double sine = n.determinant() / (n.row(0).norm() * n.row(1).norm());
  if (!(std::abs(sine) > 0.05)) return false;
  const Eigen::Matrix2d inverse = n.inverse();
  *corner = inverse * c;
  const auto variance = [&](const EdgeRefiner::EdgeLine& line) {
    const Eigen::Vector2d at(1, (line.flat ? corner->x() : corner->y()) - line.u_middle);
    return at.dot(line.covariance * at);
  };
  const Eigen::Vector2d variances(variance(a), variance(b));
  *covariance = inverse * variances.asDiagonal() * inverse.transpose();
  *covariance += k_systematic_px * k_systematic_px * Eigen::Matrix2d::Identity();
  return corner->allFinite();
}

bool is_convex(const std::array<Eigen::Vector2d, 4>& corners) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d a = corners[(i + 1) % 4] - corners[i];
    const Eigen::Vector2d b = corners[(i + 2) % 4] - corners[(i + 1) % 4];
    if (a.x() * b.y() - a.y() * b.x() <= 0) return false;
  }
  return true;
}

double shortest_side(const std::array<Eigen::Vector2d, 4>& corners) {
  double shortest = (corners[0] - corners[3]).norm();
  for (std::size_t i = 0; i < 3; ++i) shortest = std::min(shortest, (corners[i + 1] - corners[i]).norm());
  return shortest;
}

}  // namespace

std::optional<RefinedQuad> EdgeRefiner::refine(const cv::Mat& grey,
                                               const Quad& quad,
                                               double min_contrast,
                                               const Lens* lens) {
  RefinedQuad refined;
  refined.corners_px = quad.corners_px;
  constexpr int k_rounds = 2;  // the second one's windows and bow start from the first one's corners
  for (int round = 0; round < k_rounds; ++round) {
    const double reach =
        std::clamp(0.22 * shortest_side(refined.corners_px), 2.5, static_cast<double>(k_max_reach));
    std::array<EdgeLine, 4> lines;
    for (std::size_t side = 0; side < 4; ++side) {
      if (!fit_side(grey, refined.corners_px, side, reach, min_contrast, lens, &lines[side]))
        return std::nullopt;
      refined.outside_level[side] = lines[side].outside_level;
      refined.inside_level[side] = lines[side].inside_level;
    }
    std::array<Eigen::Vector2d, 4> corners;
    for (std::size_t i = 0; i < 4; ++i) {
      if (!intersect(lines[(i + 3) % 4], lines[i], &corners[i], &refined.corner_covariance[i]))
        return std::nullopt;
      if ((corners[i] - quad.corners_px[i]).norm() > 3 + 0.1 * reach) return std::nullopt;
    }
    refined.corners_px = corners;
    if (!is_convex(corners)) return std::nullopt;
  }
  return refined;
}

}  // namespace limn::tracker
