#include "tracker/shadow_edges.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/median.h"
#include "tracker/local_undistortion.h"
#include "tracker/quad_sampler.h"

namespace limn::tracker {
namespace {

constexpr double k_dark = 1;       // light, of 255, added to both sides of a ratio
constexpr double k_unlike = 0.15;  // largest difference of a side's ratio from the others, natural logarithms
constexpr double k_like = 0.3;     // the same for one place
// Distance from a cell's border to the sampled places on both sides of it.
constexpr double k_beside_cells = 0.3;
// Share of the shortest side: a little more than a cell of most families.
constexpr double k_reach_share = 0.14;
constexpr int k_max_reach = 12;        // pixels
constexpr int k_edge_px = 3;           // largest distance from an edge to where its levels are measured
constexpr double k_max_blur_px = 1.2;  // with more blur there are no flat levels there
constexpr int k_rows = 24;             // sampled across each side
constexpr int k_most_a_row = 4;        // falls of light in a row: more are texture
constexpr double k_end_share = 0.06;   // share of a side that is left out at each end, where other edges are
constexpr double k_on_line_px = 0.75;
constexpr double k_min_rows_share = 0.35;   // share of the rows that must agree with a line
constexpr double k_more_rows_share = 1.25;  // times the rows that agree with the present side
constexpr double k_beside_px = 0.15;        // error of a line by another edge nearby
constexpr double k_doubt_px = 1.5;  // error of a side that a shadow's edge hides: measured on slatted shadow
// Pixels that a corner moves for one pixel of its side. At flatter angles it is not moved.
constexpr double k_max_slide = 4;
constexpr double k_min_run = 0.4;  // share of the side between the two places that define a line

double log_ratio(double outside, double inside) { return std::log((outside + k_dark) / (inside + k_dark)); }

double light_of(double level, const std::array<double, 256>& light) {
  return light[static_cast<std::size_t>(std::clamp(std::lround(level), 0L, 255L))];
}

// The logarithm of the ratio between the light of white cells and of black cells beside them. Shadows end
// between some cells, so it is taken from the most similar quarter of all pairs.
std::optional<double> ratio_of_cells(const cv::Mat& grey,
                                     const std::array<double, 256>& light,
                                     const RefinedQuad& refined,
                                     const SeenCells& cells) {
  constexpr std::size_t k_most = 2 * 2 * SeenCells::k_max * (SeenCells::k_max - 1);
  static_assert(k_most <= QuadSampler::k_most);
  std::array<float, k_most> x, y;  // white place and black place of each pair in turn
  std::size_t places = 0;
  const auto add = [&](int row, int column, int down, int right) {
    if (cells.is_white(row, column) == cells.is_white(row + down, column + right)) return;
    const bool here = cells.is_white(row, column);
    for (const bool white : {true, false}) {
      const double beyond = 0.5 + (white == here ? -k_beside_cells : k_beside_cells);
      x[places] = static_cast<float>((column + 0.5 + right * beyond) / cells.count);
      y[places++] = static_cast<float>((row + 0.5 + down * beyond) / cells.count);
    }
  };
  for (int row = 0; row < cells.count; ++row)
    for (int column = 0; column < cells.count; ++column) {
      if (column + 1 < cells.count) add(row, column, 0, 1);
      if (row + 1 < cells.count) add(row, column, 1, 0);
    }
  if (places == 0) return std::nullopt;
  std::array<float, k_most> levels;
  QuadSampler(grey, refined.corners_px).between({x.data(), places}, {y.data(), places}, levels.data());
  std::array<double, k_most / 2> ratios{};
  const std::size_t count = places / 2;
  for (std::size_t i = 0; i < count; ++i)
    ratios[i] = log_ratio(light_of(levels[2 * i], light), light_of(levels[2 * i + 1], light));
  std::sort(ratios.begin(), ratios.begin() + static_cast<std::ptrdiff_t>(count));
  const std::size_t some = count / 4;
  std::size_t best = 0;
  for (std::size_t i = 1; i + some < count; ++i)
    if (ratios[i + some] - ratios[i] < ratios[best + some] - ratios[best]) best = i;
  return 0.5 * (ratios[best] + ratios[best + some]);
}

// A place near a side: `along` the side, 0 to 1, and `across` it, in pixels inward.
struct Place {
  double along, across;
};

struct Places {
  std::array<Place, static_cast<std::size_t>(k_rows* k_most_a_row)> some;
  std::size_t count = 0;
  const Place* begin() const { return some.data(); }
  const Place* end() const { return some.data() + count; }
};

struct Side {
  Eigen::Vector2d from, run, inward;
};

Side side_of(const std::array<Eigen::Vector2d, 4>& corners, std::size_t i) {
  const Eigen::Vector2d run = corners[(i + 1) % 4] - corners[i];
  return {corners[i], run, Eigen::Vector2d(-run.y(), run.x()).normalized()};  // corners run clockwise, y down
}

double light_at(const cv::Mat& grey, const std::array<double, 256>& light, const Eigen::Vector2d& px) {
  const int x = std::clamp(static_cast<int>(std::floor(px.x())), 0, grey.cols - 2);
  const int y = std::clamp(static_cast<int>(std::floor(px.y())), 0, grey.rows - 2);
  const double right = std::clamp(px.x() - x, 0.0, 1.0);
  const double down = std::clamp(px.y() - y, 0.0, 1.0);
  const std::uint8_t* upper = grey.ptr(y) + x;
  const std::uint8_t* lower = grey.ptr(y + 1) + x;
  return (1 - down) * ((1 - right) * light[upper[0]] + right * light[upper[1]]) +
         down * ((1 - right) * light[lower[0]] + right * light[lower[1]]);
}

// The places across a side of the undistorted image where light falls by about the factor exp(`expected`).
Places places_like(const cv::Mat& grey,
                   const std::array<double, 256>& light,
                   const LocalUndistortion& image,
                   const Side& side,
                   int reach,
                   double expected) {
  Places places;
  const int around = reach + k_edge_px + 1;
  std::array<double, 2 * (k_max_reach + k_edge_px + 1) + 1> across;
  const Eigen::Vector2d aside = side.run.normalized();
  for (int row = 0; row < k_rows; ++row) {
    const double along = k_end_share + (1 - 2 * k_end_share) * row / (k_rows - 1);
    const Eigen::Vector2d middle = image.bent(side.from + along * side.run);
    for (int k = -around; k <= around; ++k) {
      const Eigen::Vector2d px = middle + k * side.inward;
      across[static_cast<std::size_t>(k + around)] =
          (light_at(grey, light, px - aside) + light_at(grey, light, px) +
           light_at(grey, light, px + aside)) /
          3;
    }
    const auto at = [&](int k) { return across[static_cast<std::size_t>(k + around)]; };
    const auto fall = [&](int k) { return (at(k) + k_dark) / (at(k + 1) + k_dark); };
    int found = 0;
    for (int k = -reach; k < reach && found < k_most_a_row; ++k) {
      if (fall(k) < fall(k - 1) || fall(k) <= fall(k + 1)) continue;
      int before = k;  // place where light falls least on this side of the edge
      int after = k;
      while (before > k - k_edge_px && fall(before - 1) < fall(before)) --before;
      while (after < k + k_edge_px && fall(after + 1) < fall(after)) ++after;
      const double outside = 0.5 * (at(before) + at(before + 1));
      const double inside = 0.5 * (at(after) + at(after + 1));
      if (std::abs(log_ratio(outside, inside) - expected) > k_like) continue;
      const double middle = 0.5 * (outside + inside);
      int crossed = before;
      while (crossed < after && at(crossed + 1) > middle) ++crossed;
      const double step = at(crossed) - at(crossed + 1);
      ++found;
      places.some[places.count++] = {
          along, crossed + std::clamp((at(crossed) - middle) / std::max(step, 1e-6), 0.0, 1.0)};
    }
  }
  return places;
}

// A line, by its distance inward at a side's start and end.
struct Line {
  double at_start = 0, at_end = 0;
  double across(double along) const { return at_start + along * (at_end - at_start); }
  bool holds(const Place& p) const { return std::abs(p.across - across(p.along)) < k_on_line_px; }
};

int rows_on(const Places& places, const Line& line) {
  int count = 0;
  double last = -1;
  for (const Place& p : places)
    if (p.along != last && line.holds(p)) {
      ++count;
      last = p.along;
    }
  return count;
}

// The line that most rows agree with.
struct Agreed {
  Line line;
  std::array<double, 2> variance{};  // at its start and end, px^2
  bool by_many = false, elsewhere = false;
};

Agreed agreed_line(const Places& places) {
  Agreed agreed;
  const int here = rows_on(places, {});
  int most = here;
  for (const Place& a : places)
    for (const Place& b : places) {
      if (b.along - a.along < k_min_run) continue;
      const double slope = (b.across - a.across) / (b.along - a.along);
      const double start = a.across - slope * a.along;
      const Line line{start, start + slope};
      const int rows = rows_on(places, line);
      if (rows <= most || rows <= k_more_rows_share * here) continue;
      most = rows;
      agreed.line = line;
      agreed.elsewhere = true;
    }
  agreed.by_many = most >= k_min_rows_share * k_rows;
  if (!agreed.elsewhere || !agreed.by_many) return agreed;
  // Least squares of the line's start and end over the places on it.
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  double squares = 0;
  double count = 0;
  for (const Place& p : places) {
    if (!agreed.line.holds(p)) continue;
    const Eigen::Vector2d row(1 - p.along, p.along);
    normal += row * row.transpose();
    right += p.across * row;
    squares += p.across * p.across;
    ++count;
  }
  const Eigen::Matrix2d inverse = normal.inverse();
  const Eigen::Vector2d ends = inverse * right;
  agreed.line = {ends[0], ends[1]};
  const double variance = std::max(0.0, squares - right.dot(ends)) / (count - 2);
  for (int i = 0; i < 2; ++i)
    agreed.variance[static_cast<std::size_t>(i)] = variance * inverse(i, i) + k_beside_px * k_beside_px;
  return agreed;
}

// How a corner moves along the neighbouring side when side `side` of the quad `before` moves inward by a
// pixel.
Eigen::Vector2d slide(const std::array<Eigen::Vector2d, 4>& before, std::size_t side, std::size_t corner) {
  const Side here = side_of(before, side);
  const Side beside = side_of(before, corner == side ? (side + 3) % 4 : corner);
  return beside.run / beside.run.dot(here.inward);
}

}  // namespace

ShadowEdges leave_shadow_edges(const cv::Mat& grey,
                               const std::array<double, 256>& light,
                               const SeenCells& cells,
                               const Lens* lens,
                               RefinedQuad* refined) {
  if (std::min(grey.cols, grey.rows) < 2 || mean_median(refined->blur_px) > k_max_blur_px)
    return ShadowEdges::none;
  std::array<double, 4> ratio;
  for (std::size_t i = 0; i < 4; ++i)
    ratio[i] =
        log_ratio(light_of(refined->outside_level[i], light), light_of(refined->inside_level[i], light));
  const auto [least, most] = std::minmax_element(ratio.begin(), ratio.end());
  if (*most - *least < k_unlike) return ShadowEdges::none;
  const double expected = ratio_of_cells(grey, light, *refined, cells).value_or(mean_median(ratio));
  const LocalUndistortion image = LocalUndistortion::about(lens, refined->corners_px, k_max_reach);
  std::array<Eigen::Vector2d, 4> before = refined->corners_px;
  for (Eigen::Vector2d& corner : before) corner = image.straight(corner);
  std::array<Eigen::Vector2d, 4> corners = before;
  double shortest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 4; ++i) shortest = std::min(shortest, side_of(before, i).run.norm());
  const int reach = std::min(k_max_reach, static_cast<int>(k_reach_share * shortest));
  ShadowEdges made = ShadowEdges::none;
  for (std::size_t i = 0; i < 4; ++i) {
    const Agreed agreed = agreed_line(places_like(grey, light, image, side_of(before, i), reach, expected));
    const bool moves = agreed.by_many && agreed.elsewhere;
    const bool doubtful = !agreed.by_many && std::abs(ratio[i] - expected) > k_unlike;
    if (!moves && !doubtful) continue;
    made = std::max(made, moves ? ShadowEdges::left : ShadowEdges::doubtful);
    for (const bool start : {true, false}) {
      const std::size_t corner = start ? i : (i + 1) % 4;
      const Eigen::Vector2d way = slide(before, i, corner);
      if (!(way.norm() < k_max_slide)) continue;
      if (moves) {
        corners[corner] += (start ? agreed.line.at_start : agreed.line.at_end) * way;
        refined->corners_px[corner] = image.bent(corners[corner]);
      }
      const double variance = moves ? agreed.variance[start ? 0 : 1] : k_doubt_px * k_doubt_px;
      refined->corner_covariance[corner] += variance * way * way.transpose();
    }
  }
  return made;
}

}  // namespace limn::tracker
