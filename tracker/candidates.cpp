#include "tracker/candidates.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limn::tracker {
namespace {

// Largest ratio of a boundary's length to that of its bounding box. Around a convex region both have the same
// number of cracks. Noise on soft edges and small bites add some, and half as many again where all sides run
// through pixel centres, so that noise decides pixel by pixel. Regions of clutter have many more.
constexpr double k_max_roughness = 1.75;
// Smallest share of a quadrilateral's area in its bounding box, for the steepest markers that lie along a
// diagonal.
constexpr double k_min_box_share = 0.04;
// Distance at which a boundary point becomes a corner: larger than the staircase, noise and the bow that a
// lens gives a side.
constexpr double k_corner_px = 1.4;
constexpr double k_corner_share = 0.012;  // share of the boundary's length
// Largest RMS distance of a side's cracks from its line: 0.3 px for a perfect staircase, plus noise and the
// lens's bow.
constexpr double k_max_side_rms_px = 0.75;
constexpr double k_max_side_rms_share = 0.012;  // share of the side's length
constexpr double k_side_trim = 0.1;  // share of a side that is left out at each end: corners are rounded

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Whether a boundary is an outer one and is large enough for a quadrilateral.
bool is_large(const Contours::Extent& contour, double min_side_px) {
  return static_cast<double>(contour.count) >= 3 * min_side_px &&
         contour.area >= 0.5 * min_side_px * min_side_px;
}

// Whether the size, roughness and area of a boundary can be a quadrilateral's.
bool is_full(const Contours::Extent& contour, const Contours::Box& box, double min_side_px) {
  return std::max(box.width, box.height) >= min_side_px &&
         std::min(box.width, box.height) >= 0.5 * min_side_px &&
         static_cast<double>(contour.count) <= k_max_roughness * 2 * (box.width + box.height) &&
         contour.area >= k_min_box_share * box.width * box.height;
}

}  // namespace

void QuadFinder::find(CornerCodes& corners,
                      const CandidateOptions& options,
                      const std::function<void(const Quad&)>& on_quad) {
  contours_.for_each(corners, [&](const Contours::Extent& contour) {
    if (!is_large(contour, options.min_side_px)) return;
    if (!is_full(contour, contours_.box(), options.min_side_px)) return;
    contours_.find_corners(k_corner_px + k_corner_share * static_cast<double>(contour.count), k_max_corners);
    const std::size_t count = contours_.corners().size();
    if (count < 4 || count > k_max_corners) return;
    for (std::size_t from = 0; from < count; ++from) {
      corners_[from] = contours_.point(contours_.corners()[from]);
      for (std::size_t to = 0; to < count; ++to) sides_[from][to].known = false;
    }
    Quad quad;
    if (choose_quad(options.min_side_px, &quad)) on_quad(quad);
  });
}

// The line from one of the outline's corners to another, without its ends.
const QuadFinder::Side& QuadFinder::side(std::size_t from_corner, std::size_t to_corner) {
  Side& side = sides_[from_corner][to_corner];
  if (side.known) return side;
  side.known = true;
  side.straight = false;
  const std::size_t from = contours_.corners()[from_corner];
  const std::size_t to = contours_.corners()[to_corner] + (to_corner > from_corner ? 0 : contours_.size());
  const auto trim = static_cast<std::size_t>(k_side_trim * static_cast<double>(to - from) + 1);
  if (to - from < 2 * trim + 3) return side;
  const auto count = static_cast<double>(to - from - 2 * trim);
  const auto line = contours_.line(from + trim, to - trim, k_max_side_rms_px + k_max_side_rms_share * count);
  side.straight = line.has_value();
  if (line) side.line = *line;
  return side;
}

// Whether the outline makes a convex turn at the second of three of its corners.
bool QuadFinder::turns_right(std::size_t a, std::size_t b, std::size_t c) const {
  return cross(corners_[b] - corners_[a], corners_[c] - corners_[b]) > 0;
}

// Chooses the convex four of the corners whose sides are straightest.
bool QuadFinder::choose_quad(double min_side_px, Quad* quad) {
  const std::size_t n = contours_.corners().size();
  double best = std::numeric_limits<double>::infinity();
  Quad candidate;
  for (std::size_t a = 0; a + 3 < n; ++a)
    for (std::size_t b = a + 1; b + 2 < n; ++b) {
      if (!side(a, b).straight) continue;
      for (std::size_t c = b + 1; c + 1 < n; ++c) {
        if (!turns_right(a, b, c) || !side(b, c).straight) continue;
        for (std::size_t d = c + 1; d < n; ++d) {
          if (!turns_right(b, c, d) || !turns_right(c, d, a) || !turns_right(d, a, b)) continue;
          if (!side(c, d).straight || !side(d, a).straight) continue;
          const double squares = side(a, b).line.squares + side(b, c).line.squares + side(c, d).line.squares +
                                 side(d, a).line.squares;
          if (squares >= best || !fit_quad({a, b, c, d}, min_side_px, &candidate)) continue;
          best = squares;
          *quad = candidate;
        }
      }
    }
  return std::isfinite(best);
}

bool QuadFinder::fit_quad(const std::array<std::size_t, 4>& corners, double min_side_px, Quad* quad) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Contours::Line& before = side(corners[(i + 3) % 4], corners[i]).line;
    const Contours::Line& after = side(corners[i], corners[(i + 1) % 4]).line;
    const double sine = cross(before.d, after.d);
    // 3.4 degrees: the sharpest corner of a marker that is 84 degrees steep
    if (std::abs(sine) < 0.06) return false;
    const double along = cross(after.p - before.p, after.d) / sine;
    quad->corners_px[i] = before.p + along * before.d;
    if ((quad->corners_px[i] - corners_[corners[i]]).norm() > 2.5 + 0.1 * before.count) return false;
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
