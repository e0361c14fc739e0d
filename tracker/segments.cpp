#include "tracker/segments.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tracker/simd.h"

namespace limn::tracker {
namespace {

// Sobel's |across| + |down| of a sharp step is 4 times the step; an edge blurred to sigma 2 keeps 2/5 of it.
constexpr int k_strength_of_level = 2;
constexpr int k_min_pixels = 5;       // of a segment, at half size
constexpr float k_max_rms_px = 0.7F;  // rounding to pixels alone gives 0.3
constexpr float k_max_turn = 0.87F;   // cosine of a pixel's gradient to the line's normal: 30 degrees
constexpr int k_gap_px = 3;           // that are jumped at once, and more on longer lines
constexpr float k_gap_share = 0.2F;
constexpr int k_max_gap_px = 8;

LIMN_SIMD void halve_row(const std::uint8_t* __restrict upper,
                         const std::uint8_t* __restrict lower,
                         int width,
                         std::uint8_t* __restrict half) {
  for (int x = 0; x < width; ++x)
    half[x] = static_cast<std::uint8_t>(
        (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) >> 2);
}

// Of the pixels 1 ... width - 2 of the middle row.
LIMN_SIMD void gradient_row(const std::uint8_t* __restrict a,
                            const std::uint8_t* __restrict b,
                            const std::uint8_t* __restrict c,
                            int width,
                            std::int16_t* __restrict across,
                            std::int16_t* __restrict down,
                            std::uint16_t* __restrict strength) {
  for (int x = 1; x < width - 1; ++x) {
    const auto gx = static_cast<std::int16_t>((a[x + 1] + 2 * b[x + 1] + c[x + 1]) -
                                              (a[x - 1] + 2 * b[x - 1] + c[x - 1]));
    const auto gy =
        static_cast<std::int16_t>((c[x - 1] + 2 * c[x] + c[x + 1]) - (a[x - 1] + 2 * a[x] + a[x + 1]));
    across[x] = gx;
    down[x] = gy;
    const auto ax = static_cast<std::int16_t>(gx < 0 ? -gx : gx);
    const auto ay = static_cast<std::int16_t>(gy < 0 ? -gy : gy);
    strength[x] = static_cast<std::uint16_t>(ax + ay);
  }
}

// The gradient's way in 256ths of a turn, lowest bit set (Rajan and others 2006, "Efficient approximations
// for the arctangent function": to a sixth of a 256th).
LIMN_SIMD void way_row(const std::int16_t* __restrict across,
                       const std::int16_t* __restrict down,
                       int width,
                       std::uint8_t* __restrict way) {
  for (int x = 1; x < width - 1; ++x) {
    const int gx = across[x];
    const int gy = down[x];
    const int ax = gx < 0 ? -gx : gx;
    const int ay = gy < 0 ? -gy : gy;
    const int low = ax < ay ? ax : ay;
    const int high = ax < ay ? ay : ax;
    const float share = static_cast<float>(low) / static_cast<float>(high + (high == 0));
    const int octant = static_cast<int>(share * (32.0F + 11.12F * (1 - share)) + 0.5F);
    const int quarter = ax < ay ? 64 - octant : octant;
    const int half = gx < 0 ? 128 - quarter : quarter;
    way[x] = static_cast<std::uint8_t>((gy < 0 ? 256 - half : half) | 1);
  }
}

// Clears what is no maximum across the edge.
LIMN_SIMD void ridge_row(const std::int16_t* __restrict across,
                         const std::int16_t* __restrict down,
                         const std::uint16_t* __restrict upper,
                         const std::uint16_t* __restrict middle,
                         const std::uint16_t* __restrict lower,
                         int width,
                         std::uint16_t min_strength,
                         std::uint8_t* __restrict ridge) {
  for (int x = 1; x < width - 1; ++x) {
    const std::uint16_t m = middle[x];
    const auto ax = static_cast<std::int16_t>(across[x] < 0 ? -across[x] : across[x]);
    const auto ay = static_cast<std::int16_t>(down[x] < 0 ? -down[x] : down[x]);
    const bool steep = ax >= ay;
    const std::uint16_t left = middle[x - 1], right = middle[x + 1], above = upper[x], below = lower[x];
    const std::uint16_t before = steep ? left : above;
    const std::uint16_t after = steep ? right : below;
    const bool is_ridge = (m >= min_strength) & (m > before) & (m >= after);
    ridge[x] = static_cast<std::uint8_t>(ridge[x] * is_ridge);
  }
}

struct Ways {
  std::array<float, 256> x, y;
};

Ways all_ways() {
  Ways ways;
  for (std::size_t i = 0; i < 256; ++i) {
    const double angle = static_cast<double>(i) * std::numbers::pi / 128;
    ways.x[i] = static_cast<float>(std::cos(angle));
    ways.y[i] = static_cast<float>(std::sin(angle));
  }
  return ways;
}
const Ways k_ways = all_ways();

}  // namespace

void SegmentFinder::Line::add(float px, float py) {
  n += 1, x += px, y += py;
  xx += px * px, xy += px * py, yy += py * py;
}

void SegmentFinder::Line::fit() {
  next_fit = n < 5 ? n + 1 : 1.5F * n;
  middle = {x / n, y / n};
  const float sxx = xx / n - middle.x() * middle.x();
  const float sxy = xy / n - middle.x() * middle.y();
  const float syy = yy / n - middle.y() * middle.y();
  const float apart = 0.5F * (sxx - syy);
  const float root = std::sqrt(apart * apart + sxy * sxy);
  // The eigenvector of the larger eigenvalue, the way that does not cancel.
  Eigen::Vector2f axis = apart > 0 ? Eigen::Vector2f(apart + root, sxy) : Eigen::Vector2f(sxy, root - apart);
  const float length = axis.norm();
  if (!(length > 0)) return;
  axis /= length;
  direction = axis.dot(direction) < 0 ? Eigen::Vector2f(-axis) : axis;
}

void SegmentFinder::find(const cv::Mat& grey, int min_contrast, std::vector<Segment>& segments) {
  segments.clear();
  if (grey.cols < 16 || grey.rows < 16) return;
  halve(grey);
  find_ridges(k_strength_of_level * min_contrast);
  // Only every fifth pixel of a row starts one, by turns: each straight run of five has such a pixel, single
  // ones mostly have not.
  for (int y = 1; y < height_ - 1; ++y) {
    const std::uint8_t* row = &ridge_[at(0, y)];
    for (int x = 1 + (2 * y) % 5; x < width_ - 1; x += 5) {
      Segment segment;
      if (row[x] && follow(x, y, &segment)) segments.push_back(segment);
    }
  }
}

void SegmentFinder::halve(const cv::Mat& grey) {
  width_ = grey.cols / 2;
  height_ = grey.rows / 2;
  half_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (int y = 0; y < height_; ++y) halve_row(grey.ptr(2 * y), grey.ptr(2 * y + 1), width_, &half_[at(0, y)]);
}

void SegmentFinder::find_ridges(int min_strength) {
  const auto width = static_cast<std::size_t>(width_);
  ridge_.assign(half_.size(), 0);
  across_.resize(2 * width);
  down_.resize(2 * width);
  strength_.assign(3 * width, 0);
  // Row y's gradients, then the ridges of the row before, whose lower neighbour is known by now.
  const auto strengths = [&](int y) { return &strength_[static_cast<std::size_t>(y % 3) * width]; };
  const auto gradient_of = [&](int y) { return static_cast<std::size_t>(y % 2) * width; };
  for (int y = 1; y < height_; ++y) {
    if (y < height_ - 1)
      gradient_row(&half_[at(0, y - 1)], &half_[at(0, y)], &half_[at(0, y + 1)], width_,
                   &across_[gradient_of(y)], &down_[gradient_of(y)], strengths(y));
    else
      std::fill_n(strengths(y), width, std::uint16_t{0});
    if (y == 1) continue;
    way_row(&across_[gradient_of(y - 1)], &down_[gradient_of(y - 1)], width_, &ridge_[at(0, y - 1)]);
    ridge_row(&across_[gradient_of(y - 1)], &down_[gradient_of(y - 1)], strengths(y + 1), strengths(y - 1),
              strengths(y), width_, static_cast<std::uint16_t>(min_strength), &ridge_[at(0, y - 1)]);
  }
}

// The segment through an edge pixel, both ways. Its pixels belong to no other.
bool SegmentFinder::follow(int x, int y, Segment* segment) {
  Line line;
  line.origin_x = x;
  line.origin_y = y;
  const std::uint8_t way = ridge_[at(x, y)];
  line.direction = Eigen::Vector2f(-k_ways.y[way], k_ways.x[way]);
  line.add(0, 0);
  ridge_[at(x, y)] = 0;
  const Eigen::Vector2i to = walk(line, {x, y}, 1);
  const Eigen::Vector2i from = walk(line, {x, y}, -1);
  if (line.n < k_min_pixels) return false;
  line.fit();
  const Eigen::Vector2f normal(-line.direction.y(), line.direction.x());
  const float c = normal.dot(line.middle);
  const float squares = normal.x() * normal.x() * line.xx + 2 * normal.x() * normal.y() * line.xy +
                        normal.y() * normal.y() * line.yy - line.n * c * c;
  if (squares > k_max_rms_px * k_max_rms_px * line.n) return false;
  const Eigen::Vector2f origin(static_cast<float>(x), static_cast<float>(y));
  const auto on_line = [&](const Eigen::Vector2i& p) {
    const Eigen::Vector2f q = p.cast<float>() - origin - line.middle;
    const Eigen::Vector2f nearest = origin + line.middle + line.direction.dot(q) * line.direction;
    return Eigen::Vector2d(2 * nearest.cast<double>() + Eigen::Vector2d(0.5, 0.5));
  };
  segment->from = on_line(from);
  segment->to = on_line(to);
  segment->direction = line.direction.cast<double>();
  segment->length = (segment->to - segment->from).norm();
  return true;
}

// Goes on along the line, one pixel of its main axis at a time; the last pixel that belonged to it.
Eigen::Vector2i SegmentFinder::walk(Line& line, const Eigen::Vector2i& start, int way) {
  Eigen::Vector2i last = start;
  int missed = 0;
  while (true) {
    const bool flat = std::abs(line.direction.x()) >= std::abs(line.direction.y());
    const int u_axis = flat ? 0 : 1;
    const int v_axis = 1 - u_axis;
    const int forward = line.direction[u_axis] > 0 ? way : -way;
    const float slope = line.direction[v_axis] / line.direction[u_axis];
    const int u_origin = flat ? line.origin_x : line.origin_y;
    const int v_origin = flat ? line.origin_y : line.origin_x;
    const int u_limit = flat ? width_ : height_;
    const int v_limit = flat ? height_ : width_;
    const std::ptrdiff_t v_stride = flat ? width_ : 1;
    const float offset = static_cast<float>(v_origin) + line.middle[v_axis] - slope * line.middle[u_axis];
    // The gradient of an edge along the line: dark lies on its right.
    const float gradient_x = line.direction.y();
    const float gradient_y = -line.direction.x();
    const auto belongs = [&](std::uint8_t way_there) {
      return way_there != 0 &&
             gradient_x * k_ways.x[way_there] + gradient_y * k_ways.y[way_there] > k_max_turn;
    };
    const int gap =
        line.n < k_min_pixels ? 1 : std::min(k_max_gap_px, k_gap_px + static_cast<int>(k_gap_share * line.n));
    bool refit = false;
    for (int u = last[u_axis] + forward * (missed + 1); !refit; u += forward) {
      const float v = offset + slope * static_cast<float>(u - u_origin) + 0.5F;
      const int v_px = static_cast<int>(v);
      if (u < 1 || u >= u_limit - 1 || !(v >= 2) || v_px >= v_limit - 2) return last;
      std::uint8_t* middle = &ridge_[flat ? at(u, v_px) : at(v_px, u)];
      const int nearer = v - static_cast<float>(v_px) > 0.5F ? 1 : -1;
      const int side = belongs(*middle)                      ? 0
                       : belongs(middle[nearer * v_stride])  ? nearer
                       : belongs(middle[-nearer * v_stride]) ? -nearer
                                                             : 2;
      if (side == 2) {
        if (++missed > gap) return last;
        continue;
      }
      middle[side * v_stride] = 0;
      last[u_axis] = u;
      last[v_axis] = v_px + side;
      line.add(static_cast<float>(last.x() - line.origin_x), static_cast<float>(last.y() - line.origin_y));
      missed = 0;
      refit = line.n >= line.next_fit;
    }
    line.fit();  // another slope
  }
}

}  // namespace limn::tracker
