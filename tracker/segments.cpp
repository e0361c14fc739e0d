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
constexpr int k_max_turn = 21;        // of a pixel's gradient to the line's normal, 256ths: 30 degrees
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

struct Ways {  // unit vectors
  std::array<float, 256> x, y;
  Ways() {
    for (std::size_t i = 0; i < 256; ++i) {
      const double angle = static_cast<double>(i) * std::numbers::pi / 128;
      x[i] = static_cast<float>(std::cos(angle));
      y[i] = static_cast<float>(std::sin(angle));
    }
  }
};

}  // namespace

void SegmentFinder::Line::fit() {
  next_fit = n < 5 ? n + 2 : n < 20 ? 1.5F * n : 2 * n;
  const float share = 1 / n;
  middle = {share * x, share * y};
  const float sxx = share * xx - middle.x() * middle.x();
  const float sxy = share * xy - middle.x() * middle.y();
  const float syy = share * yy - middle.y() * middle.y();
  const float apart = 0.5F * (sxx - syy);
  const float root = std::sqrt(apart * apart + sxy * sxy);
  // The eigenvector of the larger eigenvalue, the way that does not cancel.
  Eigen::Vector2f axis = apart > 0 ? Eigen::Vector2f(apart + root, sxy) : Eigen::Vector2f(sxy, root - apart);
  const float square = axis.squaredNorm();
  if (!(square > 0)) return;
  const float cosine = axis.dot(direction);
  axis *= (cosine < 0 ? -1.0F : 1.0F) / std::sqrt(square);
  // The turn is small: its sine will do.
  constexpr auto k_ways_of_radian = static_cast<float>(128 / std::numbers::pi);
  way += k_ways_of_radian * (direction.x() * axis.y() - direction.y() * axis.x());
  direction = axis;
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
  static const Ways ways;
  const std::uint8_t way = ridge_[at(x, y)];
  line.way = way;
  line.direction = {-ways.y[way], ways.x[way]};  // dark on its right
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
  int last_x = start.x();
  int last_y = start.y();
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
    const auto v_limit = static_cast<float>((flat ? height_ : width_) - 2);
    const std::ptrdiff_t v_stride = flat ? width_ : 1;
    const std::ptrdiff_t u_step = forward * (flat ? 1 : width_);
    const float v_step = slope * static_cast<float>(forward);
    const int first_way = static_cast<int>(line.way) - k_max_turn;
    const auto belongs = [first_way](int way_there) {
      return (way_there & 1) & static_cast<int>(((way_there - first_way) & 255) <= 2 * k_max_turn);
    };
    const int gap =
        line.n < k_min_pixels ? 1 : std::min(k_max_gap_px, k_gap_px + static_cast<int>(k_gap_share * line.n));
    int u = (flat ? last_x : last_y) + forward * (missed + 1);
    float v = static_cast<float>(v_origin) + line.middle[v_axis] +
              slope * (static_cast<float>(u - u_origin) - line.middle[u_axis]) + 0.5F;
    std::uint8_t* row = ridge_.data() + (flat ? u : static_cast<std::ptrdiff_t>(u) * width_);
    const float next_fit = line.next_fit;
    Line sums = line;  // what is added on the way, out of reach of the pixels' stores
    while (sums.n < next_fit) {
      if (u < 1 || u >= u_limit - 1 || !(v >= 2) || v >= v_limit) {
        line = sums;
        return {last_x, last_y};
      }
      const int v_px = static_cast<int>(v);
      std::uint8_t* middle = row + v_px * v_stride;
      const int nearer = v - static_cast<float>(v_px) > 0.5F ? 1 : -1;
      const std::ptrdiff_t near_by = nearer * v_stride;
      const int here = belongs(*middle), near = belongs(middle[near_by]), far = belongs(middle[-near_by]);
      if (here | near | far) {
        const int side = here ? 0 : near ? nearer : -nearer;
        middle[side * v_stride] = 0;
        last_x = flat ? u : v_px + side;
        last_y = flat ? v_px + side : u;
        sums.add(static_cast<float>(last_x - line.origin_x), static_cast<float>(last_y - line.origin_y));
        missed = 0;
      } else if (++missed > gap) {
        line = sums;
        return {last_x, last_y};
      }
      u += forward;
      v += v_step;
      row += u_step;
    }
    line = sums;
    line.fit();  // another slope
  }
}

}  // namespace limn::tracker
