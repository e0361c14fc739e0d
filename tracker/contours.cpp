#include "tracker/contours.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "tracker/simd.h"

namespace limn::tracker {
namespace {

constexpr float k_nearly = 0.99999F;   // products may be rounded differently where they are fused
constexpr std::size_t k_block = 1024;  // points that are traced before the trail's memory is checked

constexpr std::array<int, 4> k_dx = {0, 1, 0, -1};  // up, right, down, left
constexpr std::array<int, 4> k_dy = {-1, 0, 1, 0};

using Packed = std::uint32_t;

inline int x_of(Packed point) { return static_cast<int>(point & 0xFFFF); }
inline int y_of(Packed point) { return static_cast<int>(point >> 16); }

struct Bounds {
  int low_x, high_x, low_y, high_y;
};

LIMN_SIMD Bounds bounds_of(const Packed* points, std::size_t count) {
  int low_x = x_of(points[0]), high_x = low_x, low_y = y_of(points[0]), high_y = low_y;
#pragma omp simd reduction(min : low_x, low_y) reduction(max : high_x, high_y)
  for (std::size_t i = 0; i < count; ++i) {
    const int x = x_of(points[i]), y = y_of(points[i]);
    low_x = x < low_x ? x : low_x;
    high_x = x > high_x ? x : high_x;
    low_y = y < low_y ? y : low_y;
    high_y = y > high_y ? y : high_y;
  }
  return {low_x, high_x, low_y, high_y};
}

// Points are processed in groups of this many; buffers extend that far beyond the last point.
constexpr std::size_t k_together = 16;

struct Farthest {
  float distance;
  std::size_t index;
};

// A point with the largest distance_of(x, y), which must not be negative. Lanes whose distances differ only
// in the last four bits count as equal.
template <typename DistanceOf>
__attribute__((always_inline)) inline Farthest farthest(const Packed* points,
                                                        std::size_t count,
                                                        const DistanceOf& distance_of) {
  static_assert(k_together == 16);
  std::array<float, k_together> most{};
  std::array<int, k_together> where{};
  for (std::size_t block = 0; block < count; block += k_together)
    for (std::size_t k = 0; k < k_together; ++k) {
      const auto i = static_cast<int>(block + k);
      const Packed point = points[block + k];
      const float distance = distance_of(static_cast<float>(x_of(point)), static_cast<float>(y_of(point)));
      const bool more = distance > most[k] && i < static_cast<int>(count);
      most[k] = more ? distance : most[k];
      where[k] = more ? i : where[k];
    }
  // The bits of the largest distance, which are ordered like the distance; the last four hold the lane.
  std::int32_t best = 0;
#pragma omp simd reduction(max : best)
  for (std::size_t k = 0; k < k_together; ++k) {
    const std::int32_t key = (std::bit_cast<std::int32_t>(most[k]) & ~15) | static_cast<std::int32_t>(15 - k);
    best = key > best ? key : best;
  }
  const auto lane = static_cast<std::size_t>(15 - (best & 15));
  return {most[lane], static_cast<std::size_t>(where[lane])};
}

LIMN_SIMD std::size_t farthest_from(const Packed* points, std::size_t count, Packed from) {
  const auto x0 = static_cast<float>(x_of(from)), y0 = static_cast<float>(y_of(from));
  const auto square = [=](float x, float y) { return (x - x0) * (x - x0) + (y - y0) * (y - y0); };
  return farthest(points, count, square).index;
}

struct Limits {
  float tolerance;  // half pixels
  std::size_t max_count, min_run;
};

// Adds the corners strictly between two points (Douglas and Peucker): the first point farthest from the chord
// between the ends, then the same for the pieces on both sides of it.
LIMN_SIMD void split(const Packed* points,
                     std::size_t from,
                     std::size_t to,
                     const Limits limits,
                     std::vector<std::size_t>* corners,
                     std::vector<std::size_t>* pending) {
  pending->assign(1, to);
  for (;;) {
    const std::size_t end = pending->back(), count = end - from;
    if (count >= limits.min_run && corners->size() <= limits.max_count) {
      const auto x0 = static_cast<float>(x_of(points[from])), y0 = static_cast<float>(y_of(points[from]));
      const float dx = static_cast<float>(x_of(points[end])) - x0;
      const float dy = static_cast<float>(y_of(points[end])) - y0;
      const auto from_chord = [=](float x, float y) { return std::abs(dx * (y - y0) - dy * (x - x0)); };
      const Farthest worst = farthest(points + from, count, from_chord);
      const float limit = limits.tolerance * limits.tolerance * (dx * dx + dy * dy);
      if (limit > 0 && k_nearly * worst.distance * worst.distance > limit) {
        pending->push_back(from + worst.index);
        continue;
      }
    }
    from = end;
    pending->pop_back();
    if (pending->empty()) return;
    corners->push_back(from);
  }
}

struct Moments {  // sums, in half pixels
  double x = 0, y = 0, xx = 0, xy = 0, yy = 0;
};

// Sums of coordinates relative to `origin`. They are whole numbers, so the order of summation does not
// matter.
LIMN_SIMD Moments moments_of(const Packed* points, std::size_t count, Packed origin) {
  constexpr std::size_t k_lanes = 8;
  static_assert(k_lanes <= k_together);
  using Lanes = std::array<double, k_lanes>;
  const int x0 = x_of(origin), y0 = y_of(origin);
  Lanes xs{}, ys{}, xxs{}, xys{}, yys{};
  for (std::size_t block = 0; block < count; block += k_lanes)
#pragma omp simd
    for (std::size_t k = 0; k < k_lanes; ++k) {
      const double counts = static_cast<int>(block + k) < static_cast<int>(count) ? 1 : 0;
      const double x = counts * (x_of(points[block + k]) - x0);
      const double y = counts * (y_of(points[block + k]) - y0);
      xs[k] += x;
      ys[k] += y;
      xxs[k] += x * x;
      xys[k] += x * y;
      yys[k] += y * y;
    }
  const auto sum = [](const Lanes& l) {
    return ((l[0] + l[4]) + (l[1] + l[5])) + ((l[2] + l[6]) + (l[3] + l[7]));
  };
  return {sum(xs), sum(ys), sum(xxs), sum(xys), sum(yys)};
}

}  // namespace

// Fills in the steps. Diagonal neighbours are connected: a left turn is tried first.
Contours::Steps::Steps(std::ptrdiff_t stride) {
  using C = CornerCodes;
  constexpr std::array<int, 4> ahead_left = {C::k_upper_left, C::k_upper_right, C::k_lower_right,
                                             C::k_lower_left};
  constexpr std::array<int, 4> ahead_right = {C::k_upper_right, C::k_lower_right, C::k_lower_left,
                                              C::k_upper_left};
  for (std::size_t i = 0; i < on.steps.size(); ++i) {
    const std::size_t from = i / 32;
    const auto code = static_cast<int>(i % 32);
    const std::size_t turn = code & ahead_left[from] ? 3 : code & ahead_right[from] ? 0 : 1;
    const std::size_t d = (from + turn) % 4;
    const auto step_to = [&](Way* way, std::size_t at, std::size_t direction, int sign, std::size_t next) {
      const int dx = sign * k_dx[direction], dy = sign * k_dy[direction];
      way->steps[at] = {static_cast<std::int32_t>(dx + dy * stride), static_cast<std::int16_t>(32 * next),
                        static_cast<std::int8_t>(dy),
                        static_cast<std::uint8_t>(code == C::k_lower_right ? code | C::k_visited : code)};
      way->moves[at] = static_cast<Packed>(dx) + (static_cast<Packed>(dy) << 16);
    };
    step_to(&on, i, d, 1, d);
    // Steps back: a crack behind the corner is a boundary where there is black on its right and not on its
    // left.
    if (!(code & ahead_right[(from + 1) % 4]) || code & ahead_left[(from + 3) % 4]) continue;
    step_to(&back, 32 * d + i % 32, from, -1, from);
  }
}

// Moves to the next corner and returns the middle of the crack between them.
inline Packed Contours::End::go_on(const Way& way) {
  const std::size_t from = direction + *corner;
  const Step& step = way.steps[from];
  *corner = step.code;
  direction = static_cast<std::size_t>(step.next);
  corner += step.offset;
  // Every row of codes is in another cache line.
  __builtin_prefetch(corner + 8 * std::ptrdiff_t{step.offset});
  area += std::int64_t{at & 0xFFFF} * step.dy;
  const Packed middle = at + way.moves[from];
  at = middle + way.moves[from];
  return middle;
}

// The middle of the trail, after making room for another block on both sides of its points.
Packed* Contours::Tracing::middle_with_room() {
  const std::size_t half = std::max(back, on) + k_block + k_together;
  if (trail.size() < 2 * half) {
    std::vector<Packed> wider(4 * half);
    std::copy_n(trail.begin() + static_cast<std::ptrdiff_t>(trail.size() / 2 - back), back + on,
                wider.begin() + static_cast<std::ptrdiff_t>(2 * half - back));
    trail.swap(wider);
  }
  return trail.data() + trail.size() / 2;
}

void Contours::begin(CornerCodes& corners) {
  steps_ = Steps(corners.stride);
  const std::size_t size = corners.codes.size(), half = size / 2;
  tracings_[0].next = 0, tracings_[0].until = half;
  tracings_[1].next = half, tracings_[1].until = size;
  for (Tracing& tracing : tracings_) tracing.start = nullptr;
}

// Starts the next boundary, at a corner that has black at its lower right only and is not visited. The upper
// left pixel of a region's top row has such a corner, so every outer boundary is found.
void Contours::start(CornerCodes& corners, Tracing* tracing) const {
  constexpr std::size_t k_up = 0, k_right = 32;
  std::uint8_t* const codes = corners.codes.data();
  Tracing& t = *tracing;
  t.start =
      static_cast<std::uint8_t*>(std::memchr(codes + t.next, CornerCodes::k_lower_right, t.until - t.next));
  if (!t.start) {
    t.next = t.until;
    return;
  }
  const auto from = static_cast<std::size_t>(t.start - codes);
  const auto stride = static_cast<std::size_t>(corners.stride);
  t.next = from + 1;
  const auto at = static_cast<Packed>(2 * (from % stride) + (2 * (from / stride) << 16));
  t.end = {t.start, k_up, at, 0};
  t.begin = {t.start, k_right, at, 0};
  t.on = t.back = 0;
  Packed* const middle = t.middle_with_room();
  middle[0] = t.end.go_on(steps_.on);
  middle[-1] = t.begin.go_on(steps_.back);
  t.on = t.back = 1;
  *t.start = CornerCodes::k_lower_right;  // marked as visited when the other tracing passes
}

// Moves one end by a crack; whether the two ends have met.
inline bool Contours::meets(
    const Way& way, End* moved, Packed* point, const End& end, const End& begin) const {
  *point = moved->go_on(way);
  return end.corner == begin.corner &&
         static_cast<std::size_t>(steps_.on.steps[end.direction + *end.corner].next) == begin.direction;
}

// Traces a boundary until its ends have met.
void Contours::follow(Tracing* tracing) const {
  Tracing& t = *tracing;
  for (bool closed = false; !closed;) {
    Packed* const middle = t.middle_with_room();
    Packed *on = middle + t.on, *back = middle - t.back;
    for (const Packed* const until = on + k_block; !closed && on < until;)
      closed = meets(steps_.on, &t.end, on++, t.end, t.begin) ||
               meets(steps_.back, &t.begin, --back, t.end, t.begin);
    t.on = static_cast<std::size_t>(on - middle);
    t.back = static_cast<std::size_t>(middle - back);
  }
}

// Traces both boundaries in turn, until the ends of one have met; returns that one.
Contours::Tracing& Contours::follow_both() {
  Tracing &a = tracings_[0], &b = tracings_[1];
  for (;;) {
    Packed *const a_middle = a.middle_with_room(), *const b_middle = b.middle_with_room();
    Packed *a_on = a_middle + a.on, *a_back = a_middle - a.back;
    Packed *b_on = b_middle + b.on, *b_back = b_middle - b.back;
    End a_end = a.end, a_begin = a.begin, b_end = b.end, b_begin = b.begin;
    Tracing* closed = nullptr;
    for (const Packed* const until = a_on + k_block; !closed && a_on < until;) {
      if (meets(steps_.on, &a_end, a_on++, a_end, a_begin))
        closed = &a;
      else if (meets(steps_.on, &b_end, b_on++, b_end, b_begin))
        closed = &b;
      else if (meets(steps_.back, &a_begin, --a_back, a_end, a_begin))
        closed = &a;
      else if (meets(steps_.back, &b_begin, --b_back, b_end, b_begin))
        closed = &b;
    }
    a.end = a_end, a.begin = a_begin, b.end = b_end, b.begin = b_begin;
    a.on = static_cast<std::size_t>(a_on - a_middle), a.back = static_cast<std::size_t>(a_middle - a_back);
    b.on = static_cast<std::size_t>(b_on - b_middle), b.back = static_cast<std::size_t>(b_middle - b_back);
    if (closed) return *closed;
  }
}

// The boundary whose ends meet next; nullopt when all have been traced. If the other tracing is on the same
// boundary, it is dropped.
std::optional<Contours::Extent> Contours::trace_next(CornerCodes& corners) {
  for (Tracing& tracing : tracings_)
    if (!tracing.start) start(corners, &tracing);
  const bool has_first = tracings_[0].start, has_second = tracings_[1].start;
  if (!has_first && !has_second) return std::nullopt;
  Tracing* traced = &tracings_[has_first ? 0 : 1];
  if (has_first && has_second)
    traced = &follow_both();
  else
    follow(traced);
  *traced->start |= CornerCodes::k_visited;
  if (*traced->end.corner == CornerCodes::k_lower_right) *traced->end.corner |= CornerCodes::k_visited;
  traced->start = nullptr;
  last_ = traced == &tracings_[0] ? 0 : 1;
  Tracing& other = tracings_[1 - last_];
  if (other.start && *other.start & CornerCodes::k_visited) other.start = nullptr;
  begin_ = traced->trail.size() / 2 - traced->back;
  count_ = traced->on + traced->back;
  return Extent{count_, 0.5 * static_cast<double>(traced->end.area - traced->begin.area)};
}

Contours::Box Contours::box() const {
  const Bounds bounds = bounds_of(tracings_[last_].trail.data() + begin_, count_);
  return {0.5 * (bounds.high_x - bounds.low_x), 0.5 * (bounds.high_y - bounds.low_y)};
}

void Contours::find_corners(double tolerance_px, std::size_t max_count, std::size_t min_run) {
  // Repeat the points before the first corner behind the last point, and leave room for reading whole groups.
  std::vector<Packed>& trail = tracings_[last_].trail;
  const std::size_t most = begin_ + 2 * count_ + k_together;
  if (trail.size() < most) trail.resize(most);
  const auto begin = trail.begin() + static_cast<std::ptrdiff_t>(begin_);
  const std::size_t first = farthest_from(&*begin, count_, *begin);
  std::copy_n(begin, first + 1, begin + static_cast<std::ptrdiff_t>(count_));
  points_ = std::span(trail).subspan(begin_ + first, count_ + 1);
  const std::size_t second = farthest_from(points_.data(), count_, points_[0]);
  corners_.clear();
  corners_.push_back(0);
  const Limits limits{static_cast<float>(2 * tolerance_px), max_count, std::max<std::size_t>(2, min_run)};
  split(points_.data(), 0, second, limits, &corners_, &pending_);
  corners_.push_back(second);
  split(points_.data(), second, count_, limits, &corners_, &pending_);
}

std::optional<Contours::Line> Contours::line(std::size_t from, std::size_t to, double max_rms_px) const {
  if (from >= count_) return line(from - count_, to - count_, max_rms_px);
  const std::size_t end = std::min(to, count_);
  Moments sum = moments_of(&points_[from], end - from, points_[0]);
  if (to > end) {
    const Moments more = moments_of(&points_[0], to - end, points_[0]);
    sum = {sum.x + more.x, sum.y + more.y, sum.xx + more.xx, sum.xy + more.xy, sum.yy + more.yy};
  }
  const auto n = static_cast<double>(to - from);
  const double x = 0.5 / n * sum.x;
  const double y = 0.5 / n * sum.y;
  const double xx = 0.25 / n * sum.xx - x * x;
  const double xy = 0.25 / n * sum.xy - x * y;
  const double yy = 0.25 / n * sum.yy - y * y;
  const double apart = 0.5 * (xx - yy);
  const double square = apart * apart + xy * xy;
  // The smaller eigenvalue is middle - sqrt(square).
  const double middle = 0.5 * (xx + yy);
  const double beyond = middle - max_rms_px * max_rms_px;
  if (beyond > 0 && beyond * beyond > square) return std::nullopt;
  const double root = std::sqrt(square);
  Line line;
  line.p = point(0) + Eigen::Vector2d(x, y);
  // The eigenvector of the larger eigenvalue, by the formula without cancellation.
  line.d = apart > 0 ? Eigen::Vector2d(apart + root, xy) : Eigen::Vector2d(xy, root - apart);
  line.d /= std::max(1e-12, line.d.norm());
  line.squares = n * std::max(0.0, middle - root);
  line.count = n;
  const auto point_around = [&](std::size_t i) { return point(i > count_ ? i - count_ : i); };
  if (line.d.dot(point_around(to) - point(from)) < 0) line.d = -line.d;
  return line;
}

}  // namespace limn::tracker
