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
constexpr double k_corner_share = 0.012;       // share of the boundary's length
constexpr double k_corner_height_share = 0.3;  // and at most this share of the height, for steep markers
// Largest RMS distance of a side's cracks from its line: 0.3 px for a perfect staircase, plus noise and the
// lens's bow.
constexpr double k_max_side_rms_px = 0.75;
constexpr double k_max_side_rms_share = 0.012;  // share of the side's length
constexpr double k_side_trim = 0.1;  // share of a side that is left out at each end: corners are rounded

// Quadrilaterals with a broken side: smaller ones cannot be told from clutter.
constexpr double k_min_broken_px = 24;
constexpr std::size_t k_rough_points = 150, k_most_stride = 8;  // points of a boundary for the rough look
constexpr std::size_t k_long_boundary = 2000;  // only parts of longer ones are looked at closely
constexpr double k_rough_corner_px = 2.5;
constexpr double k_min_half_width = 1.5;  // px: writing and lines have less, and white margins have more
constexpr double k_even_rms_px = 0.8;  // RMS distance of a side's cracks: something may break one with more
constexpr double k_min_piece_share = 0.1;         // share of the side
constexpr double k_min_pieces_share = 0.4;        // both together
constexpr double k_max_broken_rms_share = 0.006;  // share of the side's length
constexpr double k_most_beside_px = 1.5;          // at the ends of the two pieces, from their common line

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

bool is_uneven(const Contours::Line& side) {
  return side.squares > k_even_rms_px * k_even_rms_px * side.count;
}

}  // namespace

void QuadFinder::find(CornerCodes& corners,
                      const CandidateOptions& options,
                      const std::function<void(const Quad&)>& on_quad) {
  contours_.for_each(corners, [&](const Contours::Extent& contour) {
    if (find_quad(contour, options.min_side_px, on_quad) && !is_uneven_) return;
    if (options.broken_sides) find_broken_side(contour, options.min_side_px, on_quad);
  });
}

// Whether the boundary describes a quadrilateral.
bool QuadFinder::find_quad(const Contours::Extent& contour,
                           double min_side_px,
                           const std::function<void(const Quad&)>& on_quad) {
  if (!is_large(contour, min_side_px)) return false;
  if (!is_full(contour, contours_.box(), min_side_px)) return false;
  const auto length = static_cast<double>(contour.count);
  const double height = 2 * contour.area / length;  // half a square's side, or a long shape's height
  contours_.find_corners(
      std::min(k_corner_px + k_corner_share * length, std::max(k_corner_px, k_corner_height_share * height)),
      k_max_corners);
  const std::size_t count = contours_.corners().size();
  if (count < 4 || count > k_max_corners) return false;
  for (std::size_t from = 0; from < count; ++from) {
    corners_[from] = contours_.point(contours_.corners()[from]);
    for (std::size_t to = 0; to < count; ++to) sides_[from][to].known = false;
  }
  Quad quad;
  if (!choose_quad(min_side_px, &quad)) return false;
  on_quad(quad);
  return true;
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
          is_uneven_ = is_uneven(side(a, b).line) || is_uneven(side(b, c).line) ||
                       is_uneven(side(c, d).line) || is_uneven(side(d, a).line);
        }
      }
    }
  return std::isfinite(best);
}

// Finds quadrilaterals along a part of the boundary: from the end piece of one side around three whole sides
// to the other end piece of the first one. A rough look at long boundaries drops nearly all of them.
void QuadFinder::find_broken_side(const Contours::Extent& contour,
                                  double min_side_px,
                                  const std::function<void(const Quad&)>& on_quad) {
  const double least = std::max(min_side_px, k_min_broken_px);
  const auto length = static_cast<double>(contour.count);
  if (length < 4 * least || std::abs(contour.area) < k_min_half_width * length) return;
  const Contours::Box box = contours_.box();
  if (std::min(box.width, box.height) < 0.5 * least) return;
  const std::size_t stride = std::clamp<std::size_t>(contour.count / k_rough_points, 2, k_most_stride);
  contours_.find_rough_corners(k_rough_corner_px, contour.count, stride);
  find_turns(least);
  if (turns_.empty()) return;
  if (contour.count <= k_long_boundary) {
    contours_.find_corners(k_corner_px, contour.count, 3);
    return find_broken_sides(least, on_quad);
  }
  // Only the surroundings of these places are looked at again.
  rough_corners_.assign(contours_.corners().begin(), contours_.corners().end());
  for (const std::size_t first : turns_) {
    if (first + 5 >= rough_corners_.size()) continue;
    const std::size_t from = rough_corners_[first] - std::min(rough_corners_[first], 2 * stride);
    contours_.find_corners_between(
        from, std::min(rough_corners_[first + 5] + 2 * stride, contours_.size() - 1), k_corner_px);
    find_broken_sides(least, on_quad);
  }
}

// Sets turns_ to the corners after which the outline turns around.
void QuadFinder::find_turns(double min_side_px) {
  turns_.clear();
  for (std::size_t first = 0; first < contours_.corners().size(); ++first)
    if (turns_around(first, min_side_px)) turns_.push_back(first);
}

void QuadFinder::find_broken_sides(double min_side_px, const std::function<void(const Quad&)>& on_quad) {
  const std::size_t count = contours_.corners().size();
  for (std::size_t first = 0; first < count; ++first)
    if (turns_around(first, min_side_px))
      if (const auto quad = quad_with_broken_side(first, min_side_px)) on_quad(*quad);
}

// Whether the outline turns right at the four corners after corner `first` and comes back to its direction.
bool QuadFinder::turns_around(std::size_t first, double min_side_px) const {
  const auto corners = contours_.corners();
  if (corners.size() < 6) return false;
  const auto point = [&](std::size_t i) { return contours_.point(corners[(first + i) % corners.size()]); };
  std::array<Eigen::Vector2d, 5> run;
  for (std::size_t i = 0; i < 5; ++i) {
    run[i] = point(i + 1) - point(i);
    if (i > 0 && cross(run[i - 1], run[i]) <= 0) return false;
    if (i > 0 && i < 4 && run[i].norm() < 0.4 * min_side_px) return false;
  }
  return run[0].dot(run[4]) > 0.8 * run[0].norm() * run[4].norm() && run[1].dot(run[3]) < 0;
}

// The quadrilateral whose broken side's last piece begins at corner `first` of the boundary.
std::optional<Quad> QuadFinder::quad_with_broken_side(std::size_t first, double min_side_px) const {
  const auto corners = contours_.corners();
  const std::size_t count = corners.size();
  const auto point = [&](std::size_t i) { return contours_.point(corners[(first + i) % count]); };
  const double side_px = (point(1) - point(4)).norm();
  const Eigen::Vector2d along = (point(1) - point(4)) / side_px;
  const double last_px = along.dot(point(1) - point(0)), first_px = along.dot(point(5) - point(4));
  if (side_px < min_side_px || std::min(last_px, first_px) < k_min_piece_share * side_px ||
      first_px + last_px < k_min_pieces_share * side_px || first_px + last_px > side_px)
    return std::nullopt;
  std::array<Contours::Line, 5> lines;
  for (std::size_t i = 0; i < 5; ++i) {
    const std::size_t from = corners[(first + i) % count];
    std::size_t to = corners[(first + i + 1) % count];
    if (to <= from) to += contours_.size();
    const auto trim = static_cast<std::size_t>(2 + k_side_trim * static_cast<double>(to - from));
    if (to - from < 2 * trim + 3) return std::nullopt;
    const auto line = contours_.line(
        from + trim, to - trim, k_max_side_rms_px + k_max_broken_rms_share * static_cast<double>(to - from));
    if (!line) return std::nullopt;
    lines[i] = *line;
  }
  // The broken side runs through the middles of its two pieces.
  Contours::Line side = lines[0];
  side.p = 0.5 * (lines[0].p + lines[4].p);
  side.d = (lines[0].p - lines[4].p).normalized();
  for (const Contours::Line* piece : {&lines[0], &lines[4]})
    if (std::abs(cross(side.d, piece->d)) > std::min(0.5, k_most_beside_px / (0.5 * piece->count)))
      return std::nullopt;
  const std::array<Contours::Line, 4> sides = {side, lines[1], lines[2], lines[3]};
  Quad quad;
  for (std::size_t i = 0; i < 4; ++i) {
    const Contours::Line &before = sides[i], &after = sides[(i + 1) % 4];
    const double sine = cross(before.d, after.d);
    if (std::abs(sine) < 0.06) return std::nullopt;
    quad.corners_px[i] = before.p + cross(after.p - before.p, after.d) / sine * before.d;
    if ((quad.corners_px[i] - point(i + 1)).norm() > 2.5 + 0.1 * side_px) return std::nullopt;
  }
  quad.side_is_broken = true;
  return quad;
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
