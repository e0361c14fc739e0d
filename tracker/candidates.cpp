#include "tracker/candidates.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "tracker/simd.h"

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
// RMS distance of a side's cracks from its line: 0.3 px for a perfect staircase, plus the same two.
constexpr double k_max_side_rms_px = 0.75;
constexpr double k_max_side_rms_share = 0.012;  // of the side's length
constexpr float k_nearly = 0.99999F;            // products may be rounded otherwise where they are fused
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

// Square of the largest distance of a point from (from_x, from_y).
LIMN_SIMD float largest_square(
    const float* __restrict x, const float* __restrict y, std::size_t count, float from_x, float from_y) {
  float largest = 0;
#pragma omp simd reduction(max : largest)
  for (std::size_t i = 0; i < count; ++i) {
    const float dx = x[i] - from_x;
    const float dy = y[i] - from_y;
    const float square = dx * dx + dy * dy;
    largest = square > largest ? square : largest;
  }
  return largest;
}

// The first of the points farthest from (from_x, from_y).
std::size_t farthest(std::span<const float> x, std::span<const float> y, float from_x, float from_y) {
  const float largest = k_nearly * largest_square(x.data(), y.data(), x.size(), from_x, from_y);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const float dx = x[i] - from_x;
    const float dy = y[i] - from_y;
    if (dx * dx + dy * dy >= largest) return i;
  }
  return 0;
}

struct Chord {
  float x, y, dx, dy;
  float distance(float px, float py) const { return std::abs(dx * (py - y) - dy * (px - x)); }
};

// Largest distance of a point from the chord, times its length.
LIMN_SIMD float largest_distance(const float* __restrict x,
                                 const float* __restrict y,
                                 std::size_t count,
                                 const Chord chord) {
  float largest = 0;
#pragma omp simd reduction(max : largest)
  for (std::size_t i = 0; i < count; ++i) {
    const float distance = std::abs(chord.dx * (y[i] - chord.y) - chord.dy * (x[i] - chord.x));
    largest = distance > largest ? distance : largest;
  }
  return largest;
}

// Whether the boundary is an outer one and could be a quadrilateral's.
bool may_be_quad(std::size_t count, double width, double height, double area, double min_side_px) {
  const auto length = static_cast<double>(count);
  return length >= 3 * min_side_px && std::max(width, height) >= min_side_px &&
         std::min(width, height) >= 0.5 * min_side_px && length <= k_max_roughness * 2 * (width + height) &&
         area >= k_min_box_share * width * height && area >= 0.5 * min_side_px * min_side_px;
}

}  // namespace

// How a boundary with black on its right goes on, by 32 * direction + corner code. Diagonal neighbours are
// connected: left first.
struct QuadFinder::Steps {
  std::array<std::ptrdiff_t, 128> offset;  // to the next corner's code
  std::array<int, 128> next;               // 32 * direction
  std::array<int, 128> dx, dy;

  explicit Steps(std::ptrdiff_t stride) {
    using C = CornerCodes;
    constexpr std::array<int, 4> ahead_left = {C::k_upper_left, C::k_upper_right, C::k_lower_right,
                                               C::k_lower_left};
    constexpr std::array<int, 4> ahead_right = {C::k_upper_right, C::k_lower_right, C::k_lower_left,
                                                C::k_upper_left};
    for (std::size_t i = 0; i < offset.size(); ++i) {
      const std::size_t from = i / 32;
      const auto code = static_cast<int>(i % 32);
      const std::size_t turn = code & ahead_left[from] ? 3 : code & ahead_right[from] ? 0 : 1;
      const std::size_t d = (from + turn) % 4;
      offset[i] = k_dx[d] + k_dy[d] * stride;
      next[i] = static_cast<int>(32 * d);
      dx[i] = k_dx[d];
      dy[i] = k_dy[d];
    }
  }
};

void QuadFinder::find(CornerCodes& corners, const CandidateOptions& options, std::vector<Quad>& quads) {
  quads.clear();
  const Steps steps(corners.stride);
  for (int y = 0; y < corners.height; ++y) {
    const std::uint8_t* row = corners.at(0, y);
    for (int x = next_start(row, 0, corners.width); x < corners.width;
         x = next_start(row, x + 1, corners.width)) {
      const Outline outline = trace(corners, steps, x, y);
      if (!may_be_quad(outline.count, 0.5 * (outline.high_x - outline.low_x),
                       0.5 * (outline.high_y - outline.low_y), 0.5 * static_cast<double>(outline.area),
                       options.min_side_px) ||
          !find_corners(outline.count))
        continue;
      sum_moments();
      Quad quad;
      if (choose_quad(options.min_side_px, &quad)) quads.push_back(quad);
    }
  }
}

// Follows the boundary that runs up to corner (x, y) and on to its right, black on its right, into the trail.
QuadFinder::Outline QuadFinder::trace(CornerCodes& corners, const Steps& steps, int x, int y) {
  constexpr std::size_t k_block = 1024;
  std::uint8_t* const start = corners.at(x, y);
  std::uint8_t* corner = start;
  Outline outline;
  std::size_t next = 0;
  int px = 2 * x - 1;  // of the corner, in half pixels
  int py = 2 * y - 1;
  outline.low_x = outline.high_x = px;
  outline.low_y = outline.high_y = py;
  do {
    if (outline.count + k_block > trail_x_.size()) {
      trail_x_.resize(2 * trail_x_.size() + k_block);
      trail_y_.resize(trail_x_.size());
    }
    float* into_x = trail_x_.data() + outline.count;
    float* into_y = trail_y_.data() + outline.count;
    std::size_t i = 0;
    do {
      const std::uint8_t code = *corner;
      // Only where boundaries start.
      *corner =
          static_cast<std::uint8_t>(code | (code == CornerCodes::k_lower_right ? CornerCodes::k_visited : 0));
      const std::size_t step = next + code;
      next = static_cast<std::size_t>(steps.next[step]);
      corner += steps.offset[step];
      const int dx = steps.dx[step];
      const int dy = steps.dy[step];
      into_x[i] = static_cast<float>(px + dx);
      into_y[i] = static_cast<float>(py + dy);
      outline.area += px * dy;
      px += 2 * dx;
      py += 2 * dy;
      outline.low_x = std::min(outline.low_x, px);
      outline.high_x = std::max(outline.high_x, px);
      outline.low_y = std::min(outline.low_y, py);
      outline.high_y = std::max(outline.high_y, py);
    } while (++i < k_block && corner != start);
    outline.count += i;
  } while (corner != start);
  return outline;
}

// Indices of boundary points that are corners of its outline (Douglas and Peucker from two far points).
bool QuadFinder::find_corners(std::size_t count) {
  // The trail twice over, so that it can begin anywhere.
  for (auto* trail : {&trail_x_, &trail_y_}) {
    if (trail->size() < 2 * count + 1) trail->resize(2 * count + 1);
    std::copy_n(trail->begin(), count, trail->begin() + static_cast<std::ptrdiff_t>(count));
  }
  x_ = std::span(trail_x_).first(count);
  y_ = std::span(trail_y_).first(count);
  const std::size_t first = farthest(x_, y_, x_[0], y_[0]);
  x_ = std::span(trail_x_).subspan(first, count + 1);
  y_ = std::span(trail_y_).subspan(first, count + 1);
  const std::size_t second = farthest(x_, y_, x_[0], y_[0]);
  const auto tolerance = static_cast<float>(2 * (k_corner_px + k_corner_share * static_cast<double>(count)));
  corners_.clear();
  corners_.push_back(0);
  split(0, second, tolerance);
  corners_.push_back(second);
  split(second, count, tolerance);
  return corners_.size() >= 4 && corners_.size() <= k_max_corners;
}

// Adds the corners strictly between two indices of the boundary; the last point is the first again. The
// tolerance is in half pixels.
void QuadFinder::split(std::size_t from, std::size_t to, float tolerance) {
  if (to < from + 2 || corners_.size() > k_max_corners) return;
  const Chord chord{x_[from], y_[from], x_[to] - x_[from], y_[to] - y_[from]};
  const float length = std::hypot(chord.dx, chord.dy);
  if (length == 0) return;
  const float worst = k_nearly * largest_distance(&x_[from], &y_[from], to - from, chord);
  if (worst <= tolerance * length) return;
  std::size_t at = from + 1;
  while (at + 1 < to && chord.distance(x_[at], y_[at]) < worst) ++at;
  split(from, at, tolerance);
  corners_.push_back(at);
  split(at, to, tolerance);
}

// Pixels, from the boundary's first point.
void QuadFinder::sum_moments() {
  sums_.resize(x_.size());
  sums_[0] = Moments{};
  for (std::size_t i = 0; i + 1 < x_.size(); ++i) {
    const double x = 0.5 * (x_[i] - x_[0]);
    const double y = 0.5 * (y_[i] - y_[0]);
    const Moments& m = sums_[i];
    sums_[i + 1] = {m.x + x, m.y + y, m.xx + x * x, m.xy + x * y, m.yy + y * y};
  }
  for (auto& row : sides_)
    for (Side& side : row) side.known = false;
}

// Total least squares line of the boundary between two corners, without its ends.
const QuadFinder::Side& QuadFinder::side(std::size_t from_corner, std::size_t to_corner) {
  Side& side = sides_[from_corner][to_corner];
  if (side.known) return side;
  side.known = true;
  side.straight = false;
  const std::size_t around = x_.size() - 1;
  const std::size_t from = corners_[from_corner];
  const std::size_t to = corners_[to_corner] + (to_corner > from_corner ? 0 : around);
  const auto trim = static_cast<std::size_t>(k_side_trim * static_cast<double>(to - from) + 1);
  if (to - from < 2 * trim + 3) return side;
  const auto sum_to = [&](std::size_t i) {
    Moments m = sums_[i < around ? i : i - around];
    if (i < around) return m;
    const Moments& all = sums_[around];
    return Moments{m.x + all.x, m.y + all.y, m.xx + all.xx, m.xy + all.xy, m.yy + all.yy};
  };
  const Moments a = sum_to(from + trim);
  const Moments b = sum_to(to - trim);
  const auto n = static_cast<double>(to - from - 2 * trim);
  const double x = (b.x - a.x) / n;
  const double y = (b.y - a.y) / n;
  const double xx = (b.xx - a.xx) / n - x * x;
  const double xy = (b.xy - a.xy) / n - x * y;
  const double yy = (b.yy - a.yy) / n - y * y;
  // The eigenvector of the larger eigenvalue, the way that does not cancel.
  const double apart = 0.5 * (xx - yy);
  const double root = std::sqrt(apart * apart + xy * xy);
  side.p = point(0) + Eigen::Vector2d(x, y);
  side.d = apart > 0 ? Eigen::Vector2d(apart + root, xy) : Eigen::Vector2d(xy, root - apart);
  side.d /= std::max(1e-12, side.d.norm());
  const double spread = std::max(0.0, 0.5 * (xx + yy) - root);
  side.squares = n * spread;
  side.count = n;
  side.straight = std::sqrt(spread) <= k_max_side_rms_px + k_max_side_rms_share * n;
  return side;
}

// The four corners among those found whose sides are straightest.
bool QuadFinder::choose_quad(double min_side_px, Quad* quad) {
  const std::size_t n = corners_.size();
  double best = std::numeric_limits<double>::infinity();
  Quad candidate;
  for (std::size_t a = 0; a + 3 < n; ++a)
    for (std::size_t b = a + 1; b + 2 < n; ++b) {
      if (!side(a, b).straight) continue;
      for (std::size_t c = b + 1; c + 1 < n; ++c) {
        if (!side(b, c).straight) continue;
        for (std::size_t d = c + 1; d < n; ++d) {
          if (!side(c, d).straight || !side(d, a).straight) continue;
          const double squares =
              side(a, b).squares + side(b, c).squares + side(c, d).squares + side(d, a).squares;
          if (squares >= best || !fit_quad({a, b, c, d}, min_side_px, &candidate)) continue;
          best = squares;
          *quad = candidate;
        }
      }
    }
  return std::isfinite(best);
}

bool QuadFinder::fit_quad(const std::array<std::size_t, 4>& corners, double min_side_px, Quad* quad) {
  const auto at = [&](std::size_t i) { return point(corners_[corners[i % 4]]); };
  for (std::size_t i = 0; i < 4; ++i)  // the found corners as they are: convex, nearly
    if (cross(at(i + 1) - at(i), at(i + 2) - at(i + 1)) <= 0) return false;
  for (std::size_t i = 0; i < 4; ++i) {
    const Side& before = side(corners[(i + 3) % 4], corners[i]);
    const Side& after = side(corners[i], corners[(i + 1) % 4]);
    const double sine = cross(before.d, after.d);
    if (std::abs(sine) < 0.06) return false;  // 3.4 degrees: the sharpest corner of a marker 84 degrees steep
    const double along = cross(after.p - before.p, after.d) / sine;
    quad->corners_px[i] = before.p + along * before.d;
    if ((quad->corners_px[i] - at(i)).norm() > 2.5 + 0.1 * before.count) return false;
  }
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i) {  // convex, clockwise as seen, no side too short
    const Eigen::Vector2d along = quad->corners_px[(i + 1) % 4] - quad->corners_px[i];
    const Eigen::Vector2d next = quad->corners_px[(i + 2) % 4] - quad->corners_px[(i + 1) % 4];
    if (cross(along, next) <= 0 || along.norm() < 0.5 * min_side_px) return false;
    longest = std::max(longest, along.norm());
  }
  return longest >= min_side_px;
}

}  // namespace limn::tracker
