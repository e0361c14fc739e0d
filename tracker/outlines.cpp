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

struct Box {
  float low_x, high_x, low_y, high_y;
};

LIMN_SIMD Box box_of(const float* __restrict x, const float* __restrict y, std::size_t count) {
  float low_x = x[0], high_x = x[0], low_y = y[0], high_y = y[0];
#pragma omp simd reduction(min : low_x, low_y) reduction(max : high_x, high_y)
  for (std::size_t i = 0; i < count; ++i) {
    low_x = x[i] < low_x ? x[i] : low_x;
    high_x = x[i] > high_x ? x[i] : high_x;
    low_y = y[i] < low_y ? y[i] : low_y;
    high_y = y[i] > high_y ? y[i] : high_y;
  }
  return {low_x, high_x, low_y, high_y};
}

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

// Points are looked at by so many: buffers reach as far behind the last.
constexpr std::size_t k_together = 16;

struct Limits {
  float tolerance;  // half pixels
  std::size_t max_count, min_run;
};

// Adds the corners strictly between two points (Douglas and Peucker): of a piece the first of the points
// farthest from the chord between its ends, and so on on both sides.
LIMN_SIMD void split(const float* __restrict x,
                     const float* __restrict y,
                     std::size_t from,
                     std::size_t to,
                     const Limits limits,
                     std::vector<std::size_t>* corners,
                     std::vector<std::size_t>* pending) {
  pending->assign(1, to);
  for (;;) {
    const std::size_t end = pending->back(), count = end - from;
    std::size_t at = from;
    const float x0 = x[from], y0 = y[from], dx = x[end] - x0, dy = y[end] - y0;
    const float length = std::sqrt(dx * dx + dy * dy);
    if (count >= limits.min_run && corners->size() <= limits.max_count && length > 0) {
      std::array<float, k_together> most{};
      std::array<int, k_together> where{};
      for (std::size_t block = 0; block < count; block += k_together)
        for (std::size_t k = 0; k < k_together; ++k) {
          const auto i = static_cast<int>(block + k);
          const float distance = std::abs(dx * (y[from + block + k] - y0) - dy * (x[from + block + k] - x0));
          const bool more = distance > most[k] && i < static_cast<int>(count);
          most[k] = more ? distance : most[k];
          where[k] = more ? i : where[k];
        }
      float worst = 0;
      for (const float distance : most) worst = std::max(worst, distance);
      if (k_nearly * worst > limits.tolerance * length) {
        int first = static_cast<int>(count);
        for (std::size_t k = 0; k < k_together; ++k)
          first = most[k] == worst ? std::min(first, where[k]) : first;
        at = from + static_cast<std::size_t>(first);
      }
    }
    if (at > from) {
      pending->push_back(at);
      continue;
    }
    from = end;
    pending->pop_back();
    if (pending->empty()) return;
    corners->push_back(from);
  }
}

}  // namespace

// Diagonal neighbours are connected: left first.
Outlines::Steps::Steps(std::ptrdiff_t stride) {
  using C = CornerCodes;
  constexpr std::array<int, 4> ahead_left = {C::k_upper_left, C::k_upper_right, C::k_lower_right,
                                             C::k_lower_left};
  constexpr std::array<int, 4> ahead_right = {C::k_upper_right, C::k_lower_right, C::k_lower_left,
                                              C::k_upper_left};
  for (std::size_t i = 0; i < on.size(); ++i) {
    const std::size_t from = i / 32;
    const auto code = static_cast<int>(i % 32);
    const std::size_t turn = code & ahead_left[from] ? 3 : code & ahead_right[from] ? 0 : 1;
    const std::size_t d = (from + turn) % 4;
    const auto step_to = [&](std::size_t direction, int sign, std::size_t next) {
      return Step{static_cast<std::int32_t>(sign * (k_dx[direction] + k_dy[direction] * stride)),
                  static_cast<std::int16_t>(32 * next), static_cast<std::int8_t>(sign * k_dx[direction]),
                  static_cast<std::int8_t>(sign * k_dy[direction])};
    };
    on[i] = step_to(d, 1, d);
    // What lies behind, on both sides: black on the right alone is a boundary.
    if (!(code & ahead_right[(from + 1) % 4]) || code & ahead_left[(from + 3) % 4]) continue;
    back[32 * d + i % 32] = step_to(from, -1, from);
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

struct Outlines::End {
  std::uint8_t* corner;
  std::size_t direction;  // times 32
  int x, y;               // of the corner, in half pixels
  long long area = 0;     // half pixels times pixels

  void go_on(const std::array<Step, 128>& steps, float* into_x, float* into_y) {
    const std::uint8_t code = *corner;
    // Only where boundaries start.
    *corner =
        static_cast<std::uint8_t>(code | (code == CornerCodes::k_lower_right ? CornerCodes::k_visited : 0));
    const Step& step = steps[direction + code];
    direction = static_cast<std::size_t>(step.next);
    corner += step.offset;
    __builtin_prefetch(corner + 8 * step.offset);  // every row of codes is another cache line
    *into_x = static_cast<float>(x + step.dx);
    *into_y = static_cast<float>(y + step.dy);
    area += x * step.dy;
    x += 2 * step.dx;
    y += 2 * step.dy;
  }
};

// Follows the boundary that runs up to corner (x, y) and on to its right, black on its right, into the trail:
// from both of its ends in turn, so that neither has to wait for what it reads.
Outlines::Extent Outlines::trace(CornerCodes& corners, Start from) {
  constexpr std::size_t k_block = 1024;
  constexpr std::size_t k_up = 0, k_right = 32;
  std::uint8_t* const start = corners.at(from.x, from.y);
  End end{start, k_up, 2 * from.x - 1, 2 * from.y - 1};
  End begin{start, k_right, 2 * from.x - 1, 2 * from.y - 1};
  // Whether the way on from the end is the way that the beginning has come.
  const auto have_met = [&] {
    return end.corner == begin.corner &&
           static_cast<std::size_t>(steps_.on[end.direction + *end.corner].next) == begin.direction;
  };
  std::size_t on = 0, back = 0;
  for (bool closed = false; !closed;) {
    if (on + k_block > back_x_.size()) {
      back_x_.resize(2 * back_x_.size() + k_block);
      back_y_.resize(back_x_.size());
      trail_x_.resize(std::max(trail_x_.size(), 2 * back_x_.size()));
      trail_y_.resize(trail_x_.size());
    }
    float* const on_x = trail_x_.data();
    float* const on_y = trail_y_.data();
    float* const back_x = back_x_.data();
    float* const back_y = back_y_.data();
    for (const std::size_t until = on + k_block; on < until;) {
      end.go_on(steps_.on, on_x + on, on_y + on);
      ++on;
      if ((closed = have_met())) break;
      begin.go_on(steps_.back, back_x + back, back_y + back);
      ++back;
      if ((closed = have_met())) break;
    }
  }
  if (*end.corner == CornerCodes::k_lower_right) *end.corner |= CornerCodes::k_visited;
  const auto backs = static_cast<std::ptrdiff_t>(back), ons = static_cast<std::ptrdiff_t>(on);
  std::reverse_copy(back_x_.begin(), back_x_.begin() + backs, trail_x_.begin() + ons);
  std::reverse_copy(back_y_.begin(), back_y_.begin() + backs, trail_y_.begin() + ons);
  count_ = on + back;
  const Box box = box_of(trail_x_.data(), trail_y_.data(), count_);
  return {count_, 0.5 * static_cast<double>(box.high_x - box.low_x),
          0.5 * static_cast<double>(box.high_y - box.low_y),
          0.5 * static_cast<double>(end.area - begin.area)};
}

void Outlines::find_corners(double tolerance_px, std::size_t max_count, std::size_t min_run) {
  // The trail twice over, so that it can begin anywhere.
  for (auto* trail : {&trail_x_, &trail_y_}) {
    if (trail->size() < 2 * count_ + k_together) trail->resize(2 * count_ + k_together);
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
  const Limits limits{static_cast<float>(2 * tolerance_px), max_count, std::max<std::size_t>(2, min_run)};
  split(x_.data(), y_.data(), 0, second, limits, &corners_, &pending_);
  corners_.push_back(second);
  split(x_.data(), y_.data(), second, count_, limits, &corners_, &pending_);
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
