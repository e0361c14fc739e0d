#include "tracker/candidates.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace limn::tracker {
namespace {

// The cracks around a convex region are exactly as many as around its bounding box. Noise on soft edges and
// small bites add some, and half as many again where all sides run through pixel centres, whose noise then
// decides pixel by pixel; regions of clutter have many more.
constexpr double k_max_roughness = 1.75;
// A quadrilateral's area is at least this share of its bounding box, for the steepest markers along a
// diagonal.
constexpr double k_min_box_share = 0.04;
// Distance at which a boundary point makes a corner: staircase and noise, and the bow that a lens gives a
// side.
constexpr double k_corner_px = 1.4;
constexpr double k_corner_share = 0.012;  // of the boundary's length
constexpr std::size_t k_max_corners = 10;
// RMS distance of a side's cracks from its line: 0.3 px for a perfect staircase, plus the same two.
constexpr double k_max_side_rms_px = 0.75;
constexpr double k_max_side_rms_share = 0.012;  // of the side's length
constexpr double k_side_trim = 0.1;             // of a side at each end: corners are round

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// First corner in [x, count) with black at its lower right alone, not visited; count when there is none. The
// upper left pixel of a region's top row has one, so every outer boundary runs through such corners. Words of
// 8 corners.
int next_start(const std::uint8_t* row, int x, int count) {
  constexpr std::uint64_t k_ones = 0x0101010101010101;
  while (x < count) {
    std::uint64_t word = 0;
    std::memcpy(&word, row + x, 8);
    const std::uint64_t starts = (word >> 3) & ~word & ~(word >> 1) & ~(word >> 2) & ~(word >> 4) & k_ones;
    if (starts != 0) return std::min(count, x + __builtin_ctzll(starts) / 8);
    x += 8;
  }
  return count;
}

constexpr std::array<int, 4> k_dx = {0, 1, 0, -1};  // up, right, down, left
constexpr std::array<int, 4> k_dy = {-1, 0, 1, 0};

// Where a boundary with black on its right goes on, by 16 * direction + corner code. Diagonal neighbours are
// connected: left first.
constexpr std::array<std::uint8_t, 64> next_directions() {
  using C = CornerCodes;
  constexpr std::array<int, 4> ahead_left = {C::k_upper_left, C::k_upper_right, C::k_lower_right,
                                             C::k_lower_left};
  constexpr std::array<int, 4> ahead_right = {C::k_upper_right, C::k_lower_right, C::k_lower_left,
                                              C::k_upper_left};
  std::array<std::uint8_t, 64> next{};
  for (std::size_t d = 0; d < 4; ++d)
    for (int code = 0; code < 16; ++code) {
      const std::size_t turn = code & ahead_left[d] ? 3 : code & ahead_right[d] ? 0 : 1;
      next[16 * d + static_cast<std::size_t>(code)] = static_cast<std::uint8_t>((d + turn) % 4);
    }
  return next;
}

}  // namespace

void QuadFinder::find(CornerCodes& corners, const CandidateOptions& options, std::vector<Quad>& quads) {
  quads.clear();
  for (int y = 0; y < corners.height; ++y) {
    const std::uint8_t* row = corners.at(0, y);
    for (int x = next_start(row, 0, corners.width); x < corners.width;
         x = next_start(row, x + 1, corners.width)) {
      trace(corners, x, y);
      if (!may_be_quad(options.min_side_px) || !find_corners()) continue;
      sum_moments();
      Quad quad;
      if (choose_quad(options.min_side_px, &quad)) quads.push_back(quad);
    }
  }
}

// Follows the boundary that runs up to corner (x, y) and on to its right, black on its right, into boundary_.
void QuadFinder::trace(CornerCodes& corners, int x, int y) {
  static constexpr std::array<std::uint8_t, 64> k_next = next_directions();
  constexpr std::size_t k_block = 1024;
  const std::array<std::ptrdiff_t, 4> step = {-corners.stride, 1, corners.stride, -1};
  std::uint8_t* const start = corners.at(x, y);
  std::uint8_t* corner = start;
  std::size_t direction = 0;
  std::size_t count = 0;
  int px = 2 * x - 1;  // of the corner, in half pixels
  int py = 2 * y - 1;
  do {
    if (count + k_block > trail_.size()) trail_.resize(2 * trail_.size() + k_block);
    for (const std::size_t end = count + k_block; count < end;) {
      const std::uint8_t code = *corner & 15;
      // Only where boundaries start.
      *corner |= static_cast<std::uint8_t>((code == CornerCodes::k_lower_right) * CornerCodes::k_visited);
      direction = k_next[16 * direction + code];
      trail_[count++] = {px + k_dx[direction], py + k_dy[direction]};
      corner += step[direction];
      px += 2 * k_dx[direction];
      py += 2 * k_dy[direction];
      if (corner == start) break;
    }
  } while (corner != start);
  boundary_ = std::span(trail_).first(count);
}

// Whether the boundary is an outer one and could be a quadrilateral's.
bool QuadFinder::may_be_quad(double min_side_px) const {
  const double length = static_cast<double>(boundary_.size());
  if (length < 3 * min_side_px) return false;
  int low_x = boundary_[0].x, high_x = low_x, low_y = boundary_[0].y, high_y = low_y;
  for (const Crack& c : boundary_) {
    low_x = std::min(low_x, c.x);
    high_x = std::max(high_x, c.x);
    low_y = std::min(low_y, c.y);
    high_y = std::max(high_y, c.y);
  }
  const double width = 0.5 * (high_x - low_x);
  const double height = 0.5 * (high_y - low_y);
  if (std::max(width, height) < min_side_px || std::min(width, height) < 0.5 * min_side_px ||
      length > k_max_roughness * 2 * (width + height))
    return false;
  long long sum = 0;
  for (std::size_t i = 0; i < boundary_.size(); ++i) {
    const Crack& a = boundary_[i];
    const Crack& b = boundary_[i + 1 == boundary_.size() ? 0 : i + 1];
    sum += static_cast<long long>(a.x) * b.y - static_cast<long long>(b.x) * a.y;
  }
  const double area = static_cast<double>(sum) / 8;  // of half pixels, twice; negative around a hole
  return area >= k_min_box_share * width * height && area >= 0.5 * min_side_px * min_side_px;
}

// Indices of boundary points that are corners of its outline (Douglas and Peucker from two far points).
bool QuadFinder::find_corners() {
  const std::size_t count = boundary_.size();
  double mean_x = 0, mean_y = 0;
  for (const Crack& crack : boundary_) {
    mean_x += crack.x;
    mean_y += crack.y;
  }
  mean_x /= static_cast<double>(count);
  mean_y /= static_cast<double>(count);
  const auto farthest = [&](double x, double y) {
    std::size_t best = 0;
    double best_square = -1;
    for (std::size_t i = 0; i < count; ++i) {
      const double dx = boundary_[i].x - x;
      const double dy = boundary_[i].y - y;
      if (dx * dx + dy * dy > best_square) {
        best_square = dx * dx + dy * dy;
        best = i;
      }
    }
    return best;
  };
  const std::size_t first = farthest(mean_x, mean_y);
  std::rotate(boundary_.begin(), boundary_.begin() + static_cast<std::ptrdiff_t>(first), boundary_.end());
  const std::size_t second = farthest(boundary_[0].x, boundary_[0].y);
  const double tolerance = 2 * (k_corner_px + k_corner_share * static_cast<double>(count));  // half pixels
  corners_.clear();
  corners_.push_back(0);
  split(0, second, tolerance);
  corners_.push_back(second);
  split(second, count, tolerance);
  return corners_.size() >= 4 && corners_.size() <= k_max_corners;
}

// Adds the corners strictly between two indices of the boundary; `to` may be its size (the first point
// again).
void QuadFinder::split(std::size_t from, std::size_t to, double tolerance) {
  if (to < from + 2 || corners_.size() > k_max_corners) return;
  const Crack& a = boundary_[from];
  const Crack& b = boundary_[to == boundary_.size() ? 0 : to];
  const double dx = b.x - a.x;
  const double dy = b.y - a.y;
  const double length = std::hypot(dx, dy);
  if (length == 0) return;
  double worst = 0;
  std::size_t at = from;
  for (std::size_t i = from + 1; i < to; ++i) {
    const double distance = std::abs(dx * (boundary_[i].y - a.y) - dy * (boundary_[i].x - a.x));
    if (distance > worst) {
      worst = distance;
      at = i;
    }
  }
  if (worst <= tolerance * length) return;
  split(from, at, tolerance);
  corners_.push_back(at);
  split(at, to, tolerance);
}

void QuadFinder::sum_moments() {
  sums_.resize(2 * boundary_.size() + 1);  // twice around, so that sides may run past the end
  sums_[0] = Moments{};
  for (std::size_t i = 0; i < 2 * boundary_.size(); ++i) {
    const Crack& crack = boundary_[i % boundary_.size()];
    const double x = 0.5 * crack.x;
    const double y = 0.5 * crack.y;
    const Moments& m = sums_[i];
    sums_[i + 1] = {m.x + x, m.y + y, m.xx + x * x, m.xy + x * y, m.yy + y * y};
  }
}

// Total least squares line of the points from … to - 1 (indices may run once past the end).
QuadFinder::Line QuadFinder::line(std::size_t from, std::size_t to) const {
  const Moments& a = sums_[from];
  const Moments& b = sums_[to];
  const double n = static_cast<double>(to - from);
  const double x = (b.x - a.x) / n;
  const double y = (b.y - a.y) / n;
  const double xx = (b.xx - a.xx) / n - x * x;
  const double xy = (b.xy - a.xy) / n - x * y;
  const double yy = (b.yy - a.yy) / n - y * y;
  // The eigenvector of the larger eigenvalue, the way that does not cancel.
  const double apart = 0.5 * (xx - yy);
  const double root = std::sqrt(apart * apart + xy * xy);
  Line line;
  line.p = {x, y};
  line.d = apart > 0 ? Eigen::Vector2d(apart + root, xy) : Eigen::Vector2d(xy, root - apart);
  line.d /= std::max(1e-12, line.d.norm());
  const double spread = 0.5 * (xx + yy) - root;
  line.squares = n * std::max(0.0, spread);
  line.count = n;
  return line;
}

// The four corners among those found whose sides are straightest.
bool QuadFinder::choose_quad(double min_side_px, Quad* quad) const {
  const std::size_t n = corners_.size();
  double best = std::numeric_limits<double>::infinity();
  Quad candidate;
  double squares = 0;
  for (std::size_t a = 0; a + 3 < n; ++a)
    for (std::size_t b = a + 1; b + 2 < n; ++b)
      for (std::size_t c = b + 1; c + 1 < n; ++c)
        for (std::size_t d = c + 1; d < n; ++d) {
          const std::array<std::size_t, 4> four = {corners_[a], corners_[b], corners_[c], corners_[d]};
          if (!fit_quad(four, min_side_px, &candidate, &squares) || squares >= best) continue;
          best = squares;
          *quad = candidate;
        }
  return std::isfinite(best);
}

bool QuadFinder::fit_quad(const std::array<std::size_t, 4>& corners,
                          double min_side_px,
                          Quad* quad,
                          double* squares) const {
  const auto at = [&](std::size_t i) {
    return Eigen::Vector2d(0.5 * boundary_[corners[i % 4]].x, 0.5 * boundary_[corners[i % 4]].y);
  };
  for (std::size_t i = 0; i < 4; ++i)  // the found corners as they are: convex, nearly
    if (cross(at(i + 1) - at(i), at(i + 2) - at(i + 1)) <= 0) return false;
  std::array<Line, 4> sides;
  *squares = 0;
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t from = corners[i];
    const std::size_t to = i == 3 ? corners[0] + boundary_.size() : corners[i + 1];
    const auto trim = static_cast<std::size_t>(k_side_trim * static_cast<double>(to - from) + 1);
    if (to - from < 2 * trim + 3) return false;
    sides[i] = line(from + trim, to - trim);
    const double rms = std::sqrt(sides[i].squares / sides[i].count);
    if (rms > k_max_side_rms_px + k_max_side_rms_share * sides[i].count) return false;
    *squares += sides[i].squares;
  }
  for (std::size_t i = 0; i < 4; ++i) {
    const Line& before = sides[(i + 3) % 4];
    const Line& after = sides[i];
    const double sine = cross(before.d, after.d);
    if (std::abs(sine) < 0.06) return false;  // 3.4 degrees: the sharpest corner of a marker 84 degrees steep
    const double along = cross(after.p - before.p, after.d) / sine;
    quad->corners_px[i] = before.p + along * before.d;
    const Crack& found = boundary_[corners[i]];
    const Eigen::Vector2d apart = quad->corners_px[i] - Eigen::Vector2d(0.5 * found.x, 0.5 * found.y);
    if (apart.norm() > 2.5 + 0.1 * before.count) return false;
  }
  for (std::size_t i = 0; i < 4; ++i) {  // convex, clockwise as seen, no side too short
    const Eigen::Vector2d side = quad->corners_px[(i + 1) % 4] - quad->corners_px[i];
    const Eigen::Vector2d next = quad->corners_px[(i + 2) % 4] - quad->corners_px[(i + 1) % 4];
    if (cross(side, next) <= 0 || side.norm() < 0.5 * min_side_px) return false;
    longest = std::max(longest, side.norm());
  }
  return longest >= min_side_px;
}

}  // namespace limn::tracker
