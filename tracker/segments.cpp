#include "tracker/segments.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

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

LIMN_SIMD void halve_row(const std::uint8_t* upper,
                         const std::uint8_t* lower,
                         int width,
                         std::uint8_t* half) {
  for (int x = 0; x < width; ++x)
    half[x] = static_cast<std::uint8_t>(
        (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) >> 2);
}

// Of the pixels 1 ... width - 2 of the middle row.
LIMN_SIMD void gradient_row(const std::uint8_t* a,
                            const std::uint8_t* b,
                            const std::uint8_t* c,
                            int width,
                            std::int16_t* across,
                            std::int16_t* down,
                            std::uint16_t* strength) {
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

LIMN_SIMD void ridge_row(const std::int16_t* across,
                         const std::int16_t* down,
                         const std::uint16_t* upper,
                         const std::uint16_t* middle,
                         const std::uint16_t* lower,
                         int width,
                         std::uint16_t min_strength,
                         std::uint8_t* ridge) {
  for (int x = 1; x < width - 1; ++x) {
    const std::uint16_t m = middle[x];
    const auto ax = static_cast<std::int16_t>(across[x] < 0 ? -across[x] : across[x]);
    const auto ay = static_cast<std::int16_t>(down[x] < 0 ? -down[x] : down[x]);
    const bool steep = ax >= ay;
    const std::uint16_t before = steep ? middle[x - 1] : upper[x];
    const std::uint16_t after = steep ? middle[x + 1] : lower[x];
    ridge[x] = static_cast<std::uint8_t>((m >= min_strength) & (m > before) & (m >= after));
  }
}

}  // namespace

void SegmentFinder::Line::add(float px, float py) {
  n += 1, x += px, y += py;
  xx += px * px, xy += px * py, yy += py * py;
}

void SegmentFinder::Line::fit() {
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
  const auto count = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  half_.resize(count);
  across_.resize(count);
  down_.resize(count);
  strength_.assign(count, 0);
  ridge_.assign(count, 0);
  for (int y = 0; y < height_; ++y) halve_row(grey.ptr(2 * y), grey.ptr(2 * y + 1), width_, &half_[at(0, y)]);
}

void SegmentFinder::find_ridges(int min_strength) {
  for (int y = 1; y < height_ - 1; ++y)
    gradient_row(&half_[at(0, y - 1)], &half_[at(0, y)], &half_[at(0, y + 1)], width_, &across_[at(0, y)],
                 &down_[at(0, y)], &strength_[at(0, y)]);
  for (int y = 1; y < height_ - 1; ++y)
    ridge_row(&across_[at(0, y)], &down_[at(0, y)], &strength_[at(0, y - 1)], &strength_[at(0, y)],
              &strength_[at(0, y + 1)], width_, static_cast<std::uint16_t>(min_strength), &ridge_[at(0, y)]);
}

// The segment through an edge pixel, both ways. Its pixels belong to no other.
bool SegmentFinder::follow(int x, int y, Segment* segment) {
  Line line;
  line.origin_x = x;
  line.origin_y = y;
  line.direction = Eigen::Vector2f(-down_[at(x, y)], across_[at(x, y)]).normalized();
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
    bool found = false;
    for (int u = last[u_axis] + forward * (missed + 1);; u += forward) {
      const float v = offset + slope * static_cast<float>(u - u_origin) + 0.5F;
      const int v_px = static_cast<int>(v);
      if (u < 1 || u >= u_limit - 1 || !(v >= 2) || v_px >= v_limit - 2) return last;
      const std::size_t middle = flat ? at(u, v_px) : at(v_px, u);
      const int nearer = v - static_cast<float>(v_px) > 0.5F ? 1 : -1;
      for (const int side : {0, nearer, -nearer}) {
        const auto i = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(middle) + side * v_stride);
        if (!ridge_[i]) continue;
        const float gx = across_[i];
        const float gy = down_[i];
        const float along_normal = gx * line.direction.y() - gy * line.direction.x();  // dark on the right
        if (!(along_normal > 0) ||
            along_normal * along_normal < k_max_turn * k_max_turn * (gx * gx + gy * gy))
          continue;
        ridge_[i] = 0;
        last[u_axis] = u;
        last[v_axis] = v_px + side;
        line.add(static_cast<float>(last.x() - line.origin_x), static_cast<float>(last.y() - line.origin_y));
        found = true;
        break;
      }
      if (!found) {
        const int gap = line.n < k_min_pixels ? 1 : k_gap_px + static_cast<int>(k_gap_share * line.n);
        if (++missed > std::min(k_max_gap_px, gap)) return last;
        continue;
      }
      missed = 0;
      const int n = static_cast<int>(line.n);
      if (n >= 3 && (n < 6 || (n < 32 && n % 4 == 0) || n % 16 == 0)) {
        line.fit();
        break;  // another slope
      }
      found = false;
    }
  }
}

}  // namespace limn::tracker
