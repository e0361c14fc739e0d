#include "tracker/refine.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/photometric_response.h"
#include "tracker/simd.h"

namespace limn::tracker {
namespace {

// Smallest standard deviation of an edge line, however little noise there is: .002 to .004 px in images
// without noise. Effects of pixels, print and paper vary along a side and show in its residuals.
constexpr double k_systematic_px = 0.002;
// Below this share of its peak the averaged gradient counts as flat.
constexpr double k_flat_share = 0.05;
// What lies just outside the window counts as the edge's tail, increasingly: from this share of the peak to
// twice it, and from 1.5 times the next place's gradient to 2.5 times.
constexpr double k_tail_share = 0.02;
constexpr double k_tail_lead = 1.5;
// Factor for the variance of the larger of two noisy sums; the mean of its square is 1.64 times the variance.
constexpr double k_noise_of_two = 2;
// After the gradient has fallen below this share, a rise means another edge of the same direction behind the
// first: grey paper, then a white table.
constexpr double k_valley_share = 0.35;
constexpr double k_settled_corner_px = 0.05;  // corners of bent sides that moved more need a third round
constexpr double k_near_start_px = 0.1;       // corners that moved less need no second round
constexpr int k_max_reach = 10;
constexpr int k_rough_rows = 12;  // rows of a side for Effort::rough
// Share of the side's contrast: rows with less have no edge or are covered.
constexpr double k_min_share = 0.2;
constexpr int k_min_crossings = 3;
// A side's own correlation counts with this factor beside the mean of all sides, which is known better.
constexpr double k_own_correlation = 1.0 / 3;
// Sides with a larger bow than this are fitted as curves, and so are the sides opposite to them. Shorter
// sides show too little of it.
constexpr double k_min_curve_bow_share = 0.02;
constexpr double k_sharp_half = 12;     // half a side, in its blur: other edges bend more blurred sides
constexpr double k_min_room_px = 0.75;  // smallest distance of an edge from the outermost pixels' centres

// The bow of a lens against the chord, in v: t (1 - t) (c0 + c1 t + c2 t^2), with t from 0 to 1 along the
// chord.
struct Bow {
  Eigen::Vector3d c = Eigen::Vector3d::Zero();
  double u_from = 0, u_length = 1;
  double at(double u) const {
    const double t = (u - u_from) / u_length;
    return t * (1 - t) * (c[0] + t * (c[1] + t * c[2]));
  }
};

// How the image of the straight line between two pixels bends away from their chord.
Bow bow_of(const Lens& lens, const Eigen::Vector2d& from, const Eigen::Vector2d& to, bool flat) {
  Bow bow;
  const int u = flat ? 0 : 1;
  const int v = 1 - u;
  bow.u_from = from[u];
  bow.u_length = to[u] - from[u];
  const auto d_from = lens.unproject(from);
  const auto d_to = lens.unproject(to);
  if (!d_from || !d_to) return bow;
  constexpr int k_points = 5;
  Eigen::Matrix<double, k_points, 3> rows;
  Eigen::Matrix<double, k_points, 1> bends;
  for (int i = 0; i < k_points; ++i) {
    const double s = (i + 1.0) / (k_points + 1);
    const auto px = lens.project((1 - s) * *d_from + s * *d_to);
    if (!px) return bow;
    const double t = ((*px)[u] - bow.u_from) / bow.u_length;
    const double bubble = t * (1 - t);
    rows.row(i) << bubble, bubble * t, bubble * t * t;
    bends[i] = (*px)[v] - (from[v] + t * (to[v] - from[v]));
  }
  const Eigen::Matrix3d normal = rows.transpose() * rows;
  const Eigen::Vector3d c = normal.ldlt().solve(rows.transpose() * bends);
  if (c.allFinite()) bow.c = c;
  return bow;
}

}  // namespace

EdgeRefiner::EdgeRefiner(Encoding encoding, bool is_inverted) {
  const auto light_of = [&](double level) {
    return encoding == Encoding::linear ? level : 255 * linear_from_srgb(level / 255);
  };
  for (std::size_t i = 0; i < light_.size(); ++i) {
    const double level = static_cast<double>(i);
    light_[i] = is_inverted ? 255 - light_of(255 - level) : light_of(level);
  }
}

namespace {

using Profile = std::array<double, 2 * k_max_reach>;  // gradients across an edge

struct Window {
  std::size_t low, high;
  Profile parts{};  // weight of each place in [low, high)
};

Window whole(std::size_t low, std::size_t high) {
  Window window{low, high};
  for (std::size_t k = low; k < high; ++k) window.parts[k] = 1;
  return window;
}

// Places of the profile, [first, last).
struct Places {
  std::size_t first, last;
};

// A window that reaches equally far to both sides of the edge's centre: as far as [from, to) does on its
// longer side, within the places that lie in the image. If it cut off more of the blur on one side, all
// crossings of the line would shift alike, which their residuals do not show.
Window centred(const Profile& mean, std::size_t size, const Places& in_image, double from, double to) {
  Profile parts{};
  double centre = 0.5 * (from + to);
  double half = centre - from;
  constexpr int k_rounds = 3;
  for (int round = 0; round <= k_rounds; ++round) {
    double sum = 0;
    double moment = 0;
    for (std::size_t k = 0; k < size; ++k) {
      const auto at = static_cast<double>(k);
      parts[k] = std::clamp(std::min(at + 1, centre + half) - std::max(at, centre - half), 0.0, 1.0);
      sum += parts[k] * mean[k];
      moment += parts[k] * mean[k] * (at + 0.5);
    }
    if (round == k_rounds) break;
    centre = moment / sum;
    if (!(centre > 0 && centre < static_cast<double>(size)))  // gradients of both signs
      return whole(static_cast<std::size_t>(from), static_cast<std::size_t>(std::ceil(to)));
    half = std::min({std::max(centre - from, to - centre), centre - static_cast<double>(in_image.first),
                     static_cast<double>(in_image.last) - centre});
    if (!(half > 0)) return whole(static_cast<std::size_t>(from), static_cast<std::size_t>(std::ceil(to)));
  }
  return {static_cast<std::size_t>(centre - half),
          std::min(size, static_cast<std::size_t>(std::ceil(centre + half))), parts};
}

// Absolute sum of a place's gradients over all rows, minus what noise alone gives for the larger of two
// places.
double surely(const std::vector<double>& gradients,
              std::size_t rows,
              std::size_t profile,
              std::size_t place) {
  double sum = 0;
  double squares = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    const double gradient = gradients[i * profile + place];
    sum += gradient;
    squares += gradient * gradient;
  }
  const auto number = static_cast<double>(rows);
  const double noise = (number * squares - sum * sum) / (number - 1);
  return std::sqrt(std::max(0.0, sum * sum - k_noise_of_two * noise));
}

}  // namespace

// Finds the crossings of one side and fits its line. First the gradient profile, averaged along the side,
// gives the width of the edge (blur, thin margins). Then each row's centroid is computed over that window
// only.
bool EdgeRefiner::fit_side(const cv::Mat& grey,
                           const std::array<Eigen::Vector2d, 4>& corners,
                           std::size_t side,
                           double reach_px,
                           double min_contrast,
                           const Lens* lens,
                           Effort effort,
                           Sides sides,
                           const EdgeLine* before,
                           EdgeLine* line) {
  const Eigen::Vector2d& from = corners[side];
  const Eigen::Vector2d& to = corners[(side + 1) % 4];
  const Eigen::Vector2d chord = to - from;
  line->flat = std::abs(chord.x()) >= std::abs(chord.y());
  const int u_axis = line->flat ? 0 : 1;
  const int v_axis = 1 - u_axis;
  const double u_length = chord[u_axis];
  // Corners run clockwise with y down, so the inside lies to the right of the chord.
  const int inward = (line->flat ? chord.x() : -chord.y()) > 0 ? 1 : -1;
  const double slope = chord[v_axis] / u_length;
  const int reach =
      std::clamp(static_cast<int>(std::ceil(reach_px * std::hypot(1.0, slope))), 2, k_max_reach);
  const auto profile = static_cast<std::size_t>(2 * reach);
  const Bow bow = lens ? bow_of(*lens, from, to, line->flat) : Bow{};

  const int u_limit = line->flat ? grey.cols : grey.rows;
  const int v_limit = line->flat ? grey.rows : grey.cols;
  const std::ptrdiff_t v_stride = inward * (line->flat ? static_cast<std::ptrdiff_t>(grey.step[0]) : 1);
  const double u_low = std::min(from[u_axis], to[u_axis]);
  const double u_high = std::max(from[u_axis], to[u_axis]);
  const double trim = std::clamp(0.06 * (u_high - u_low), 1.0, 4.0);
  const int first = std::max(0, static_cast<int>(std::ceil(u_low + trim)));
  const int last = std::min(u_limit - 1, static_cast<int>(std::floor(u_high - trim)));

  rows_.clear();
  gradients_.resize(profile * static_cast<std::size_t>(std::max(0, last - first + 1)));
  double* gradient = gradients_.data();
  Profile mean{};
  Places in_image{0, profile};  // places that all rows have
  const int stride = effort == Effort::rough ? 1 + (last - first) / k_rough_rows : 1;
  for (int u = first; u <= last; u += stride) {
    const double straight =
        before && before->flat == line->flat ? before->at(u) : from[v_axis] + (u - from[u_axis]) * slope;
    const double v = straight + bow.at(u);
    if (!(v > k_min_room_px && v < v_limit - 1 - k_min_room_px)) continue;
    const int centre = static_cast<int>(v + 0.5);
    const std::uint8_t* pixel = line->flat ? grey.ptr(centre) + u : grey.ptr(u) + centre;
    // The number of places that lie in the image before and behind the centre; the others have no gradient.
    const int before_centre = std::min(reach, inward > 0 ? centre : v_limit - 1 - centre);
    const int behind_centre = std::min(reach, inward > 0 ? v_limit - 1 - centre : centre);
    const auto row_first = static_cast<std::size_t>(reach - before_centre);
    const auto row_last = static_cast<std::size_t>(reach + behind_centre);
    if (row_first > 0 || row_last < profile) {
      in_image = {std::max(in_image.first, row_first), std::min(in_image.last, row_last)};
      std::fill_n(gradient, profile, 0.0);
    }
    pixel -= before_centre * v_stride;
    double level = light_[*pixel];
    for (std::size_t k = row_first; k < row_last; ++k) {
      pixel += v_stride;
      const double next = light_[*pixel];
      gradient[k] = level - next;
      mean[k] += level - next;
      level = next;
    }
    gradient += profile;
    rows_.push_back({u, centre});
  }
  if (static_cast<int>(rows_.size()) < k_min_crossings || in_image.first >= in_image.last) return false;

  // The edge's window [low, high) in the averaged profile. Nearer peaks are preferred to slightly higher
  // ones.
  std::size_t peak = in_image.first;
  double best = 0;
  for (std::size_t k = in_image.first; k < in_image.last; ++k) {
    const double distance = std::abs(static_cast<double>(k) + 0.5 - reach);
    const double value = mean[k] / (1 + 0.15 * distance);
    if (value > best) {
      best = value;
      peak = k;
    }
  }
  const double flat_below = k_flat_share * mean[peak];
  std::size_t low = peak;
  std::size_t high = peak + 1;
  const double valley_below = k_valley_share * mean[peak];
  while (low > in_image.first && mean[low - 1] > flat_below &&
         !(mean[low] < valley_below && mean[low - 1] > mean[low]))
    --low;
  while (high < in_image.last && mean[high] > flat_below &&
         !(mean[high - 1] < valley_below && mean[high] > mean[high - 1]))
    ++high;
  // Separate: the profile is flat beyond the window, and neither another edge's slope nor the profile's end
  // is there.
  const bool is_cut = (low == in_image.first && low > 0) || (high == in_image.last && high < profile);
  line->separate = !is_cut && low >= 2 && high + 2 <= profile && std::abs(mean[low - 1]) <= flat_below &&
                   std::abs(mean[high]) <= flat_below && std::abs(mean[low - 2]) <= 4 * flat_below &&
                   std::abs(mean[high + 1]) <= 4 * flat_below;
  double beyond = 0;  // light beyond the window
  if (low > 1) beyond = surely(gradients_, rows_.size(), profile, low - 2);
  if (high + 1 < profile) beyond = std::max(beyond, surely(gradients_, rows_.size(), profile, high + 1));
  double contrast = 0;  // in linear light
  for (std::size_t k = low; k < high; ++k) contrast += mean[k];
  // A Gaussian's peak is its area over sigma sqrt(2 pi). The slope corrects for v not being normal to the
  // edge.
  line->blur_px = 0.4 * contrast / mean[peak] / std::hypot(1.0, slope);
  // Other light of this size at the window's end shifts all crossings by up to this much; smaller shifts are
  // more likely.
  const double unknown_px = 0.5 * static_cast<double>(high - low) * beyond / contrast;
  contrast /= static_cast<double>(rows_.size());
  if (!(contrast > 0)) return false;
  const auto is_flat = [&](std::size_t k) { return std::abs(mean[k]) <= flat_below; };
  // The share of place k that is the edge's tail.
  const auto tail = [&](std::size_t k, std::size_t beyond) {
    const double large = mean[k] / (k_tail_share * mean[peak]) - 1;
    const double leads = mean[k] - k_tail_lead * std::abs(mean[beyond]);
    return std::clamp(large, 0.0, 1.0) * (leads > 0 ? std::min(1.0, leads / std::abs(mean[beyond])) : 0.0);
  };
  Window window = whole(low, high);
  if (is_cut)
    window = centred(mean, profile, in_image, static_cast<double>(low), static_cast<double>(high));
  else if (low > 1 && high + 1 < profile && is_flat(low - 1) && is_flat(high))
    window = centred(mean, profile, in_image, static_cast<double>(low) - tail(low - 1, low - 2),
                     static_cast<double>(high) + tail(high, high + 1));

  // Rows beside a corner contain the other edge, as far as the blur reaches.
  const double blur_trim = std::min(0.2 * (u_high - u_low), 0.5 * static_cast<double>(high - low) + 0.5);
  double inside_sum = 0;  // grey levels, not linear light: only positions are computed in linear light
  double outside_sum = 0;
  crossings_.clear();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    if (row.u < u_low + blur_trim || row.u > u_high - blur_trim) continue;
    const double* gradient = &gradients_[i * profile];
    double sum = 0;
    double moment = 0;
    for (std::size_t k = window.low; k < window.high; ++k) {
      const double part = window.parts[k] * gradient[k];
      sum += part;
      moment += part * (static_cast<double>(k) + 0.5 - reach);
    }
    if (sum < k_min_share * contrast) continue;  // covered, or no edge here
    const double v = row.centre + inward * moment / sum;
    const std::uint8_t* pixel = line->flat ? grey.ptr(row.centre) + row.u : grey.ptr(row.u) + row.centre;
    inside_sum += pixel[(static_cast<std::ptrdiff_t>(high) - reach) * v_stride];
    outside_sum += pixel[(static_cast<std::ptrdiff_t>(low) - reach) * v_stride];
    crossings_.add(row.u, v - bow.at(row.u), sum / contrast);
  }
  if (static_cast<int>(crossings_.u.size()) < k_min_crossings) return false;
  settle_shares(effort);
  const auto kept = static_cast<double>(crossings_.u.size());
  line->inside_level = inside_sum / kept;
  line->outside_level = outside_sum / kept;
  if (line->outside_level - line->inside_level < min_contrast) return false;
  double variance = 0;
  if (!fit_line(effort, sides, before && before->is_curved, line, &variance)) return false;
  line->covariance(0, 0) += unknown_px * unknown_px / 6;
  line->correlation = effort == Effort::full ? correlation_along(*line, variance) : 1;
  find_ends(from[u_axis], to[u_axis], std::max(trim, blur_trim), variance, line);
  return true;
}

namespace {

// The intersection of two edges, by their tangents at the corner; repeated when they are bent.
bool intersect(const EdgeRefiner::EdgeLine& a,
               const EdgeRefiner::EdgeLine& b,
               Eigen::Vector2d* corner,
               Eigen::Matrix2d* covariance) {
  Eigen::Matrix2d n;
  Eigen::Vector2d c;
  const bool bent = a.curvature != 0 || b.curvature != 0;
  for (int round = 0; round < (bent ? 4 : 1); ++round) {
    for (int i = 0; i < 2; ++i) {
      const EdgeRefiner::EdgeLine& line = i == 0 ? a : b;
      const double u = bent ? (line.flat ? corner->x() : corner->y()) : line.u_middle;
      const double slope = line.slope_at(u);
      n.row(i) = line.flat ? Eigen::RowVector2d(-slope, 1) : Eigen::RowVector2d(1, -slope);
      c[i] = line.at(u) - slope * u;
    }
    const double sine = n.determinant() / (n.row(0).norm() * n.row(1).norm());
    if (!(std::abs(sine) > 0.05)) return false;
    *corner = n.inverse() * c;
  }
  const auto variance = [&](const EdgeRefiner::EdgeLine& line) {
    return line.variance(line.flat ? corner->x() : corner->y());
  };
  const Eigen::Matrix2d inverse = n.inverse();
  *covariance = inverse * Eigen::Vector2d(variance(a), variance(b)).asDiagonal() * inverse.transpose();
  *covariance += k_systematic_px * k_systematic_px * Eigen::Matrix2d::Identity();
  return corner->allFinite();
}

// The bow of a side's bent line, as a vector across it, in shares of half its length.
Eigen::Vector2d bow_across(const EdgeRefiner::EdgeLine& line) {
  const double slope = line.bent_terms[1];
  const Eigen::Vector2d across = line.flat ? Eigen::Vector2d(-slope, 1) : Eigen::Vector2d(1, -slope);
  return line.bent_terms[2] * line.half / across.squaredNorm() * across;
}

// The bow that two opposite sides share, in shares of half their length; 0 where they bend in opposite
// directions.
double common_bow(const EdgeRefiner::EdgeLine& a, const EdgeRefiner::EdgeLine& b) {
  const Eigen::Vector2d bow = bow_across(a), opposite = bow_across(b);
  return bow.dot(opposite) > 0 ? std::min(bow.norm(), opposite.norm()) : 0;
}

// Where one of two opposite sides bends strongly, both become curves, which their bent lines begin.
void begin_curves(std::array<EdgeRefiner::EdgeLine, 4>* lines) {
  for (std::size_t i = 0; i < 4; ++i) {
    EdgeRefiner::EdgeLine &line = (*lines)[i], &opposite = (*lines)[(i + 2) % 4];
    line.is_curved =
        std::max(bow_across(line).norm(), bow_across(opposite).norm()) > k_min_curve_bow_share &&
        std::min(line.half, opposite.half) > k_sharp_half * std::max(line.blur_px, opposite.blur_px);
    if (!line.is_curved || line.bent_terms.isZero()) continue;
    line.offset = line.bent_terms[0], line.slope = line.bent_terms[1], line.curvature = line.bent_terms[2];
  }
}

bool is_convex(const std::array<Eigen::Vector2d, 4>& corners) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d a = corners[(i + 1) % 4] - corners[i];
    const Eigen::Vector2d b = corners[(i + 2) % 4] - corners[(i + 1) % 4];
    if (a.x() * b.y() - a.y() * b.x() <= 0) return false;
  }
  return true;
}

double shortest_side(const std::array<Eigen::Vector2d, 4>& corners) {
  double shortest = (corners[0] - corners[3]).norm();
  for (std::size_t i = 0; i < 3; ++i) shortest = std::min(shortest, (corners[i + 1] - corners[i]).norm());
  return shortest;
}

}  // namespace

std::optional<RefinedQuad> EdgeRefiner::refine(const cv::Mat& grey,
                                               const Quad& quad,
                                               double min_contrast,
                                               const Lens* lens,
                                               Effort effort,
                                               Sides sides) {
  RefinedQuad refined;
  refined.corners_px = quad.corners_px;
  std::array<EdgeLine, 4> lines;
  // The second round's windows and bow start from the first round's corners.
  int rounds = effort == Effort::rough ? 1 : 2;
  for (int round = 0; round < rounds; ++round) {
    const double reach =
        std::clamp(0.22 * shortest_side(refined.corners_px), 2.5, static_cast<double>(k_max_reach));
    const std::array<EdgeLine, 4> before = lines;
    for (std::size_t side = 0; side < 4; ++side) {
      if (!fit_side(grey, refined.corners_px, side, reach, min_contrast, lens, effort, sides,
                    round > 0 ? &before[side] : nullptr, &lines[side]))
        return std::nullopt;
      refined.outside_level[side] = lines[side].outside_level;
      refined.inside_level[side] = lines[side].inside_level;
      refined.blur_px[side] = lines[side].blur_px;
    }
    if (round == 0) begin_curves(&lines);
    double correlation = 0;
    for (const EdgeLine& line : lines) correlation += 0.25 * line.correlation;
    for (EdgeLine& line : lines) {
      // A bent side of its own correlation has a shape that the terms do not describe.
      const double own = line.is_curved ? k_own_correlation * line.correlation : 0;
      line.covariance *= std::max({1.0, correlation, own});
    }
    std::array<Eigen::Vector2d, 4> corners = refined.corners_px;
    double moved = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      if (!intersect(lines[(i + 3) % 4], lines[i], &corners[i], &refined.corner_covariance[i]))
        return std::nullopt;
      double within_px = quad.within_px + 0.1 * reach;
      for (const EdgeLine* line : {&lines[(i + 3) % 4], &lines[i]})
        if (line->is_curved) within_px = std::max(within_px, quad.within_px + 0.1 * reach + line->bow_px());
      if ((corners[i] - quad.corners_px[i]).norm() > within_px) return std::nullopt;
      moved = std::max(moved, (corners[i] - refined.corners_px[i]).norm());
      refined.corner_visible[i] = lines[(i + 3) % 4].seen_at_end && lines[i].seen_at_start;
    }
    refined.corners_px = corners;
    refined.bow_share = 0;
    for (std::size_t i = 0; i < 2; ++i)
      if (lines[i].is_curved)
        refined.bow_share = std::max(refined.bow_share, common_bow(lines[i], lines[i + 2]));
    refined.separate = std::all_of(lines.begin(), lines.end(), [](const EdgeLine& l) { return l.separate; });
    if (!is_convex(corners)) return std::nullopt;
    const bool is_curved =
        std::any_of(lines.begin(), lines.end(), [](const EdgeLine& l) { return l.is_curved; });
    const bool straight =
        std::all_of(lines.begin(), lines.end(), [](const EdgeLine& l) { return l.curvature == 0; });
    if (straight && moved < k_near_start_px) break;
    if (is_curved && round > 0 && moved > k_settled_corner_px) rounds = 3;
  }
  return refined;
}

}  // namespace limn::tracker
