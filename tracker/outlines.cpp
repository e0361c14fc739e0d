#include "tracker/outlines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "tracker/simd.h"

namespace limn::tracker {
namespace {

constexpr float k_nearly = 0.99999F;  // products may be rounded otherwise where they are fused

// The first of the blocks from x on in which a boundary may start, or the end of the last whole one.
LIMN_SIMD int skip_empty(const std::uint8_t* row, int x, int count) {
  constexpr int k_block = 64;
  for (; x + k_block <= count; x += k_block) {
    std::uint8_t starts = 0;
    for (int i = 0; i < k_block; ++i)
      starts = static_cast<std::uint8_t>(starts | (row[x + i] == CornerCodes::k_lower_right));
    if (starts) break;
  }
  return x;
}

// First corner in [x, count) with black at its lower right alone, not visited; count when there is none. The
// upper left pixel of a region's top row has one, so every outer boundary runs through such corners. Words of
// 8 corners.
int next_start(const std::uint8_t* row, int x, int count) {
  x = skip_empty(row, x, count);
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

}  // namespace

Outlines::Steps::Steps(std::ptrdiff_t stride) {
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

Outlines::Start Outlines::first(const CornerCodes& corners) { return next(corners, {-1, 0}); }

Outlines::Start Outlines::next(const CornerCodes& corners, Start after) {
  for (int y = after.y, from = after.x + 1; y < corners.height; ++y, from = 0) {
    const int x = next_start(corners.at(0, y), from, corners.width);
    if (x < corners.width) return {x, y};
  }
  return {0, corners.height};
}

// Follows the boundary that runs up to corner (x, y) and on to its right, black on its right, into the trail.
Outlines::Extent Outlines::trace(CornerCodes& corners, Start from) {
  constexpr std::size_t k_block = 1024;
  std::uint8_t* const start = corners.at(from.x, from.y);
  std::uint8_t* corner = start;
  std::size_t next = 0;
  int px = 2 * from.x - 1;  // of the corner, in half pixels
  int py = 2 * from.y - 1;
  int low_x = px, high_x = px, low_y = py, high_y = py;
  long long area = 0;  // in half pixels times pixels
  count_ = 0;
  do {
    if (count_ + k_block > trail_x_.size()) {
      trail_x_.resize(2 * trail_x_.size() + k_block);
      trail_y_.resize(trail_x_.size());
    }
    float* into_x = trail_x_.data() + count_;
    float* into_y = trail_y_.data() + count_;
    std::size_t i = 0;
    do {
      const std::uint8_t code = *corner;
      // Only where boundaries start.
      *corner =
          static_cast<std::uint8_t>(code | (code == CornerCodes::k_lower_right ? CornerCodes::k_visited : 0));
      const std::size_t step = next + code;
      next = static_cast<std::size_t>(steps_.next[step]);
      corner += steps_.offset[step];
      __builtin_prefetch(corner + 8 * steps_.offset[step]);  // every row of codes is another cache line
      const int dx = steps_.dx[step];
      const int dy = steps_.dy[step];
      into_x[i] = static_cast<float>(px + dx);
      into_y[i] = static_cast<float>(py + dy);
      area += px * dy;
      px += 2 * dx;
      py += 2 * dy;
      low_x = std::min(low_x, px);
      high_x = std::max(high_x, px);
      low_y = std::min(low_y, py);
      high_y = std::max(high_y, py);
    } while (++i < k_block && corner != start);
    count_ += i;
  } while (corner != start);
  return {count_, 0.5 * (high_x - low_x), 0.5 * (high_y - low_y), 0.5 * static_cast<double>(area)};
}

void Outlines::find_corners(double tolerance_px, std::size_t max_count, std::size_t min_run) {
  tolerance_ = static_cast<float>(2 * tolerance_px);
  max_count_ = max_count;
  min_run_ = std::max<std::size_t>(2, min_run);
  // The trail twice over, so that it can begin anywhere.
  for (auto* trail : {&trail_x_, &trail_y_}) {
    if (trail->size() < 2 * count_ + 1) trail->resize(2 * count_ + 1);
    std::copy_n(trail->begin(), count_, trail->begin() + static_cast<std::ptrdiff_t>(count_));
  }
  x_ = std::span(trail_x_).first(count_);
  y_ = std::span(trail_y_).first(count_);
  const std::size_t first = farthest(x_, y_, x_[0], y_[0]);
  x_ = std::span(trail_x_).subspan(first, count_ + 1);
  y_ = std::span(trail_y_).subspan(first, count_ + 1);
  const std::size_t second = farthest(x_, y_, x_[0], y_[0]);
  corners_.clear();
  corners_.push_back(0);
  split(0, second);
  corners_.push_back(second);
  split(second, count_);
}

// Adds the corners strictly between two indices of the boundary; the last point is the first again.
void Outlines::split(std::size_t from, std::size_t to) {
  if (to < from + min_run_ || corners_.size() > max_count_) return;
  const Chord chord{x_[from], y_[from], x_[to] - x_[from], y_[to] - y_[from]};
  const float length = std::sqrt(chord.dx * chord.dx + chord.dy * chord.dy);
  if (length == 0) return;
  const float worst = k_nearly * largest_distance(&x_[from], &y_[from], to - from, chord);
  if (worst <= tolerance_ * length) return;
  std::size_t at = from + 1;
  while (at + 1 < to && chord.distance(x_[at], y_[at]) < worst) ++at;
  split(from, at);
  corners_.push_back(at);
  split(at, to);
}

// Pixels, from the boundary's first point.
void Outlines::sum_moments() {
  sums_.resize(x_.size());
  sums_[0] = Moments{};
  for (std::size_t i = 0; i + 1 < x_.size(); ++i) {
    const double x = 0.5 * (x_[i] - x_[0]);
    const double y = 0.5 * (y_[i] - y_[0]);
    const Moments& m = sums_[i];
    sums_[i + 1] = {m.x + x, m.y + y, m.xx + x * x, m.xy + x * y, m.yy + y * y};
  }
}

Outlines::Line Outlines::line(std::size_t from, std::size_t to) const {
  const auto sum_to = [&](std::size_t i) {
    if (i < size()) return sums_[i];
    const Moments& m = sums_[i - size()];
    const Moments& all = sums_[size()];
    return Moments{m.x + all.x, m.y + all.y, m.xx + all.xx, m.xy + all.xy, m.yy + all.yy};
  };
  const Moments a = sum_to(from);
  const Moments b = sum_to(to);
  const auto n = static_cast<double>(to - from);
  const double x = (b.x - a.x) / n;
  const double y = (b.y - a.y) / n;
  const double xx = (b.xx - a.xx) / n - x * x;
  const double xy = (b.xy - a.xy) / n - x * y;
  const double yy = (b.yy - a.yy) / n - y * y;
  // The eigenvector of the larger eigenvalue, the way that does not cancel.
  const double apart = 0.5 * (xx - yy);
  const double root = std::sqrt(apart * apart + xy * xy);
  Line line;
  line.p = point(0) + Eigen::Vector2d(x, y);
  line.d = apart > 0 ? Eigen::Vector2d(apart + root, xy) : Eigen::Vector2d(xy, root - apart);
  line.d /= std::max(1e-12, line.d.norm());
  line.squares = n * std::max(0.0, 0.5 * (xx + yy) - root);
  line.count = n;
  const auto point_around = [&](std::size_t i) { return point(i > size() ? i - size() : i); };
  if (line.d.dot(point_around(to) - point_around(from)) < 0) line.d = -line.d;
  return line;
}

}  // namespace limn::tracker
