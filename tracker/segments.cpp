#include "tracker/segments.h"

#include <algorithm>

#include "tracker/simd.h"

namespace limn::tracker {
namespace {

// The limit of black at half size. In shadows that take three quarters of the light, paper is darker than the
// middle between ink and bright paper, but lighter than this limit.
constexpr int k_black_share = 46;  // 256ths of the way from the darkest to the brightest
constexpr int k_black_reach = 3;   // tiles of 8 pixels of the whole image

// Lengths in the reduced image, at half or a quarter of the size.
constexpr double k_min_side = 6;           // as segment_quads.cpp needs
constexpr double k_min_blurred_side = 10;  // cells smaller than a quarter of it would blur into each other
constexpr double k_min_width = 0.8;        // half the width of a stroke: excludes writing and lines
constexpr double k_corner_px = 1.4;        // distance at which a boundary point becomes a corner
constexpr double k_trim_share = 0.1;
constexpr double k_max_rms_px = 0.75;

LIMN_SIMD void halve_row(const std::uint8_t* __restrict upper,
                         const std::uint8_t* __restrict lower,
                         int width,
                         std::uint8_t* __restrict half) {
  for (int x = 0; x < width; ++x)
    half[x] = static_cast<std::uint8_t>(
        (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) >> 2);
}

void halve(const cv::Mat& image, cv::Mat* half) {
  half->create(image.rows / 2, image.cols / 2, CV_8UC1);
  for (int y = 0; y < half->rows; ++y)
    halve_row(image.ptr(2 * y), image.ptr(2 * y + 1), half->cols, half->ptr(y));
}

}  // namespace

void SegmentFinder::find(const cv::Mat& grey, int min_contrast, Segments& segments) {
  segments.of_black.clear();
  segments.of_blurred.clear();
  if (std::min(grey.cols, grey.rows) < 8 * k_min_side) return;
  halve(grey, &half_);
  halve(half_, &quarter_);
  add_contours(half_, 2, k_min_side, {min_contrast, k_black_share, k_black_reach}, segments.of_black);
  add_contours(quarter_, 4, k_min_blurred_side, {min_contrast}, segments.of_blurred);
}

// Adds the segments of the image at 1 / scale of its size.
void SegmentFinder::add_contours(const cv::Mat& image,
                                 int scale,
                                 double min_side,
                                 const ThresholdOptions& options,
                                 std::vector<Segment>& segments) {
  WorkerTeam alone(1);
  threshold_.apply(image, options, corner_codes_, alone);
  contours_.for_each(corner_codes_, [&](const Contours::Extent& contour) {
    const auto length = static_cast<double>(contour.count);
    if (length < 2 * min_side || std::abs(contour.area) < k_min_width * length) return;
    const Contours::Box box = contours_.box();
    if (std::max(box.width, box.height) < min_side) return;
    contours_.find_corners(k_corner_px, contour.count, static_cast<std::size_t>(min_side));
    add_sides(scale, min_side, segments);
  });
}

// Adds the straight sides of the outline between its corners.
void SegmentFinder::add_sides(int scale, double min_side, std::vector<Segment>& segments) {
  const auto corners = contours_.corners();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const std::size_t from = corners[i];
    const std::size_t to = i + 1 < corners.size() ? corners[i + 1] : contours_.size();
    const auto trim = static_cast<std::size_t>(k_trim_share * static_cast<double>(to - from) + 1);
    if (to - from < 2 * trim + 3) continue;
    const Eigen::Vector2d start = contours_.point(from);
    const Eigen::Vector2d end = contours_.point(to);
    if ((end - start).norm() < min_side) continue;
    const auto line = contours_.line(from + trim, to - trim, k_max_rms_px);
    if (!line) continue;
    const auto on_line = [&](const Eigen::Vector2d& p) {
      const Eigen::Vector2d nearest = line->p + line->d.dot(p - line->p) * line->d;
      return Eigen::Vector2d(scale * nearest + Eigen::Vector2d::Constant(0.5 * (scale - 1)));
    };
    Segment segment{on_line(start), on_line(end), line->d, 0};
    segment.length = (segment.to - segment.from).norm();
    segments.push_back(segment);
  }
}

}  // namespace limn::tracker
