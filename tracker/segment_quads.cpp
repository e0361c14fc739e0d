#include "tracker/segment_quads.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <tuple>

#include "tracker/simd.h"

namespace limn::tracker {
namespace {

constexpr double k_cell_px = 64;
constexpr double k_min_length_px = 12;   // shortest segment: the directions of shorter ones are too uncertain
constexpr double k_min_sine = 0.25;      // sine of a quad's corner: steeper markers are found as regions
constexpr double k_max_opposite = -0.3;  // cosine between opposite sides
// Largest gap from a segment's end to the corner, as a share of the longer segment's length.
constexpr double k_max_gap_share = 0.9;
constexpr double k_gap_px = 6;
constexpr double k_overlap_px = 3;  // length by which a segment may run past the corner
constexpr double k_overlap_share = 0.2;
constexpr double k_max_reach_px = 75;     // distance between the segments of a corner
constexpr double k_reach_share = 1.2;     // share of the longer segment's length
constexpr std::size_t k_max_corners = 8;  // corners that are kept for a segment
constexpr double k_min_visible = 0.5;     // share of the outline
constexpr double k_min_side_visible = 0.15;
constexpr double k_min_side_px = 12;
constexpr double k_same_px = 3;  // quads are the same when all of their corners lie nearer than this
constexpr std::size_t k_max_quads = 2500;  // for each part
constexpr double k_max_collinear_sine = 0.06;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// The sides of a quadrilateral have similar lengths, so a short piece may belong to a side as long as the
// next one.
double max_gap(const Segment& a, const Segment& b) {
  return k_gap_px + k_max_gap_share * std::max(a.length, b.length);
}
double reach(const Segment& a, const Segment& b) {
  return std::min(k_max_reach_px, k_reach_share * std::max(a.length, b.length) + 2 * k_gap_px);
}
double max_overlap(const Segment& s) { return k_overlap_px + k_overlap_share * s.length; }

// Finds the corner from one segment to the next; false when they form none.
bool corner_of(const Segment& a, const Segment& b, Eigen::Vector2d* px, double* cost) {
  const double sine = cross(a.direction, b.direction);
  if (sine < k_min_sine) return false;
  const double after_a = cross(b.from - a.to, b.direction) / sine;  // from a's end; negative: within a
  const double into_b = cross(b.from - a.to, a.direction) / sine;   // from b's start; negative: before it
  if (after_a < -max_overlap(a) || after_a > max_gap(a, b)) return false;
  if (into_b < -max_gap(a, b) || into_b > max_overlap(b)) return false;
  *px = a.to + after_a * a.direction;
  *cost = (std::abs(after_a) + std::abs(into_b)) / (a.length + b.length);
  return true;
}

// A segment that others are compared with: its end, direction and length.
struct Probe {
  float x, y, dx, dy, length;
};

Probe probe_of(const Segment& s) {
  return {static_cast<float>(s.to.x()), static_cast<float>(s.to.y()), static_cast<float>(s.direction.x()),
          static_cast<float>(s.direction.y()), static_cast<float>(s.length)};
}

// Entries are compared in blocks. Runs of entries are short, and the last block contains some that do not
// belong.
constexpr int k_block = 16;

// Marks the entries that corner_of may join to the probe, and possibly some beyond the last.
LIMN_SIMD void match_corners(const Probe p,
                             const float* __restrict x,
                             const float* __restrict y,
                             const float* __restrict dx,
                             const float* __restrict dy,
                             const float* __restrict length,
                             int count,
                             std::uint8_t* __restrict matches) {
  constexpr float k_slack_px = 0.01F;  // for single precision
  constexpr auto k_reach = static_cast<float>(k_max_reach_px), k_least_gap = static_cast<float>(k_gap_px);
  constexpr auto k_gap_share = static_cast<float>(k_max_gap_share);
  constexpr auto k_least_overlap = static_cast<float>(k_overlap_px) + k_slack_px;
  constexpr auto k_more_overlap = static_cast<float>(k_overlap_share);
  const float own_overlap = k_least_overlap + k_more_overlap * p.length;
  for (int block = 0; block < count; block += k_block) {
    std::array<std::int32_t, k_block> found;
    for (int i = block; i < block + k_block; ++i) {
      const float ax = x[i] - p.x;
      const float ay = y[i] - p.y;
      const float sine = p.dx * dy[i] - p.dy * dx[i];
      // Distances along the probe to the corner, and along the entry from the corner, times sine.
      const float own = ax * dy[i] - ay * dx[i];
      const float other = ax * p.dy - ay * p.dx;
      const float longer = p.length > length[i] ? p.length : length[i];
      const float far = static_cast<float>(k_reach_share) * longer + 2 * k_least_gap;
      const float reach = k_slack_px + (far < k_reach ? far : k_reach);
      const float gap = k_least_gap + k_slack_px + k_gap_share * longer;
      const float overlap = k_least_overlap + k_more_overlap * length[i];
      found[static_cast<std::size_t>(i - block)] = (ax * ax + ay * ay <= reach * reach) &
                                                   (sine >= 0.999F * static_cast<float>(k_min_sine)) &
                                                   (own >= -own_overlap * sine) & (own <= gap * sine) &
                                                   (other >= -gap * sine) & (other <= overlap * sine);
    }
    std::copy(found.begin(), found.end(), matches + block);
  }
}

// Marks the entries that may continue the probe's line.
LIMN_SIMD void match_collinear(const Probe p,
                               float radius,
                               const float* __restrict x,
                               const float* __restrict y,
                               const float* __restrict dx,
                               const float* __restrict dy,
                               int count,
                               std::uint8_t* __restrict matches) {
  constexpr float k_sine = 1.01F * static_cast<float>(k_max_collinear_sine);
  for (int block = 0; block < count; block += k_block) {
    std::array<std::int32_t, k_block> found;
    for (int i = block; i < block + k_block; ++i) {
      const float ax = x[i] - p.x;
      const float ay = y[i] - p.y;
      const float sine = p.dx * dy[i] - p.dy * dx[i];
      const float gap = p.dx * ax + p.dy * ay;
      found[static_cast<std::size_t>(i - block)] = (ax * ax + ay * ay <= radius * radius) & (gap > 0) &
                                                   (std::abs(sine) <= k_sine) &
                                                   (p.dx * dx[i] + p.dy * dy[i] > 0);
    }
    std::copy(found.begin(), found.end(), matches + block);
  }
}

bool same(const Quad& a, const Quad& b) {
  for (std::size_t turn = 0; turn < 4; ++turn) {
    bool all = true;
    for (std::size_t i = 0; i < 4 && all; ++i)
      all = (a.corners_px[i] - b.corners_px[(i + turn) % 4]).squaredNorm() < k_same_px * k_same_px;
    if (all) return true;
  }
  return false;
}

}  // namespace

void SegmentQuadFinder::find(std::span<const Segment> segments,
                             int width,
                             int height,
                             std::size_t most,
                             std::vector<SegmentQuad>& quads,
                             WorkerTeam& team) {
  quads.clear();
  columns_ = static_cast<int>(width / k_cell_px) + 1;
  rows_ = static_cast<int>(height / k_cell_px) + 1;
  segments_.clear();
  for (const Segment& s : segments)
    if (s.length >= k_min_length_px) segments_.push_back(s);
  sort_into_cells();
  for_each_part(team, [&](Part& part) { join_collinear(part); });
  for (const Part& part : parts_) segments_.insert(segments_.end(), part.joined.begin(), part.joined.end());
  sort_into_cells();
  corners_.resize(segments_.size());
  for_each_part(team, [&](Part& part) { find_corners(part); });
  for_each_part(team, [&](Part& part) { find_quads(part); });
  for (const Part& part : parts_) quads.insert(quads.end(), part.quads.begin(), part.quads.end());
  const auto is_before = [](const SegmentQuad& a, const SegmentQuad& b) {
    if (a.visible != b.visible) return a.visible > b.visible;
    const auto corners = [](const SegmentQuad& q) {
      const auto& c = q.quad.corners_px;
      return std::tuple(c[0].x(), c[0].y(), c[2].x(), c[2].y());
    };
    return corners(a) < corners(b);
  };
  if (quads.size() > most) {
    std::nth_element(quads.begin(), quads.begin() + static_cast<std::ptrdiff_t>(most), quads.end(),
                     is_before);
    quads.resize(most);
  }
  std::sort(quads.begin(), quads.end(), is_before);
}

int SegmentQuadFinder::cell_of(const Eigen::Vector2d& px) const {
  const int column = std::clamp(static_cast<int>(px.x() / k_cell_px), 0, columns_ - 1);
  const int row = std::clamp(static_cast<int>(px.y() / k_cell_px), 0, rows_ - 1);
  return row * columns_ + column;
}

void SegmentQuadFinder::sort_into_cells() {
  cells_.begin.assign(static_cast<std::size_t>(columns_ * rows_) + 2, 0);
  for (const Segment& s : segments_) ++cells_.begin[static_cast<std::size_t>(cell_of(s.from)) + 2];
  for (std::size_t i = 2; i < cells_.begin.size(); ++i) cells_.begin[i] += cells_.begin[i - 1];
  cells_.segment.resize(segments_.size());
  for (auto* values : {&cells_.x, &cells_.y, &cells_.dx, &cells_.dy, &cells_.length})
    values->assign(segments_.size() + k_block, 0);
  for (std::uint32_t i = 0; i < segments_.size(); ++i) {
    const Segment& s = segments_[i];
    const std::size_t at = cells_.begin[static_cast<std::size_t>(cell_of(s.from)) + 1]++;
    cells_.segment[at] = i;
    cells_.x[at] = static_cast<float>(s.from.x());
    cells_.y[at] = static_cast<float>(s.from.y());
    cells_.dx[at] = static_cast<float>(s.direction.x());
    cells_.dy[at] = static_cast<float>(s.direction.y());
    cells_.length[at] = static_cast<float>(s.length);
  }
}

// Visits the segments that begin around `px` and that match(first, count, matches) marks.
template <typename Match, typename Visit>
void SegmentQuadFinder::visit(const Eigen::Vector2d& px,
                              double radius,
                              const Match& match,
                              std::vector<std::uint8_t>& matches,
                              const Visit& visit) const {
  const Eigen::Vector2d reach(radius, radius);
  const int low = cell_of(px - reach);
  const int high = cell_of(px + reach);
  const int columns = high % columns_ - low % columns_;
  for (int first = low; first + columns <= high; first += columns_) {
    const std::uint32_t begin = cells_.begin[static_cast<std::size_t>(first)];
    const std::uint32_t end = cells_.begin[static_cast<std::size_t>(first + columns) + 1];
    matches.resize(std::max<std::size_t>(matches.size(), end - begin + k_block));
    match(begin, static_cast<int>(end - begin), matches.data());
    for (std::uint32_t i = begin; i < end; i += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, &matches[i - begin], 8);
      for (; word != 0; word &= word - 1)
        if (const auto at = i + static_cast<std::uint32_t>(std::countr_zero(word) / 8); at < end)
          visit(cells_.segment[at]);
    }
  }
}

// Calls work(part) with equal shares of the segments.
template <typename Work>
void SegmentQuadFinder::for_each_part(WorkerTeam& team, const Work& work) {
  team.parallel_for(static_cast<int>(parts_.size()), [&](int i) {
    const auto p = static_cast<std::size_t>(i);
    parts_[p].first = static_cast<std::uint32_t>(segments_.size() * p / parts_.size());
    parts_[p].last = static_cast<std::uint32_t>(segments_.size() * (p + 1) / parts_.size());
    work(parts_[p]);
  });
}

// Joins two pieces of one line, between which something covers it, to one more segment.
void SegmentQuadFinder::join_collinear(Part& part) const {
  constexpr double k_max_beside_px = 1.5;
  part.joined.clear();
  for (std::uint32_t i = part.first; i < part.last; ++i) {
    const Segment& a = segments_[i];
    const double reach = std::min(k_max_reach_px, a.length + k_gap_px);
    std::uint32_t nearest = 0;
    double least = reach;
    const Probe probe = probe_of(a);
    const auto match = [&](std::uint32_t first, int entries, std::uint8_t* matches) {
      match_collinear(probe, static_cast<float>(reach), &cells_.x[first], &cells_.y[first], &cells_.dx[first],
                      &cells_.dy[first], entries, matches);
    };
    visit(a.to, reach, match, part.matches, [&](std::uint32_t j) {
      const Segment& b = segments_[j];
      const Eigen::Vector2d apart = b.from - a.to;
      const double gap = a.direction.dot(apart);
      if (j == i || gap <= 0 || gap >= least || gap > a.length + b.length) return;
      if (a.direction.dot(b.direction) < 0 ||
          std::abs(cross(a.direction, b.direction)) > k_max_collinear_sine)
        return;
      const Eigen::Vector2d whole = (b.to - a.from).normalized();
      if (std::abs(cross(whole, a.to - a.from)) > k_max_beside_px ||
          std::abs(cross(whole, b.from - a.from)) > k_max_beside_px)
        return;
      least = gap;
      nearest = j;
    });
    if (least >= reach) continue;
    const Segment& b = segments_[nearest];
    part.joined.push_back({a.from, b.to, (b.to - a.from).normalized(), (b.to - a.from).norm()});
  }
}

// Finds the corners within reach of each segment's end, best first.
void SegmentQuadFinder::find_corners(Part& part) {
  part.corners.clear();
  part.corner_end.clear();
  for (std::uint32_t i = part.first; i < part.last; ++i) {
    const Segment& here = segments_[i];
    const Probe probe = probe_of(here);
    const auto match = [&](std::uint32_t first, int count, std::uint8_t* matches) {
      match_corners(probe, &cells_.x[first], &cells_.y[first], &cells_.dx[first], &cells_.dy[first],
                    &cells_.length[first], count, matches);
    };
    part.found.clear();
    visit(here.to, k_max_reach_px, match, part.matches, [&](std::uint32_t j) {
      Corner corner{j, 0, {}};
      const Segment& next = segments_[j];
      const double near = reach(here, next);
      if ((next.from - here.to).squaredNorm() <= near * near &&
          corner_of(here, next, &corner.px, &corner.cost))
        part.found.push_back(corner);
    });
    std::sort(part.found.begin(), part.found.end(), [](const Corner& x, const Corner& y) {
      return std::tie(x.cost, x.next) < std::tie(y.cost, y.next);
    });
    if (part.found.size() > k_max_corners) part.found.resize(k_max_corners);
    part.corners.insert(part.corners.end(), part.found.begin(), part.found.end());
    part.corner_end.push_back(static_cast<std::uint32_t>(part.corners.size()));
  }
  std::size_t begin = 0;
  for (std::uint32_t i = part.first; i < part.last; ++i) {
    const std::size_t end = part.corner_end[i - part.first];
    corners_[i] = std::span(part.corners).subspan(begin, end - begin);
    begin = end;
  }
}

void SegmentQuadFinder::find_quads(Part& part) const {
  part.quads.clear();
  for (std::uint32_t i = part.first; i < part.last && part.quads.size() < k_max_quads; ++i)
    add_quads(i, part.quads);
}

// Adds all quadrilaterals whose segment with the lowest index is `first`.
void SegmentQuadFinder::add_quads(std::uint32_t first, std::vector<SegmentQuad>& quads) const {
  for (const Corner& one : corners_[first]) {
    if (one.next <= first) continue;
    for (const Corner& two : corners_[one.next]) {
      if (two.next <= first || segments_[first].direction.dot(segments_[two.next].direction) > k_max_opposite)
        continue;
      for (const Corner& three : corners_[two.next]) {
        if (three.next <= first) continue;
        Eigen::Vector2d last;
        double cost = 0;
        if (!corner_of(segments_[three.next], segments_[first], &last, &cost)) continue;
        const std::array<std::uint32_t, 4> sides = {first, one.next, two.next, three.next};
        SegmentQuad found{{{last, one.px, two.px, three.px}}, 0};
        double around = 0;
        double seen = 0;
        bool plausible = true;
        for (std::size_t k = 0; k < 4 && plausible; ++k) {
          const Eigen::Vector2d side = found.quad.corners_px[(k + 1) % 4] - found.quad.corners_px[k];
          const Segment& s = segments_[sides[k]];
          const double length = side.norm();
          plausible =
              length >= k_min_side_px && side.dot(s.direction) > 0 && s.length >= k_min_side_visible * length;
          around += length;
          seen += std::min(length, s.length);
        }
        found.visible = seen / around;
        if (!plausible || found.visible < k_min_visible) continue;
        if (std::none_of(quads.rbegin(),
                         quads.rbegin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(quads.size(), 8)),
                         [&](const SegmentQuad& q) { return same(q.quad, found.quad); }))
          quads.push_back(found);
      }
    }
  }
}

}  // namespace limn::tracker
