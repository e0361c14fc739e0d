#include "tracker/refine.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/median.h"
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
constexpr double k_settled_px = 2e-3;
constexpr double k_settled_corner_px = 0.05;  // corners of bent sides that moved more need a third round
constexpr double k_near_start_px = 0.1;       // corners that moved less need no second round
constexpr int k_max_reach = 10;
constexpr int k_rough_rows = 12;  // rows of a side for Effort::rough
constexpr double k_huber = 1.5;   // in robust standard deviations
constexpr double k_reject = 4;    // in the same unit: crossings beyond it belong to something else
// Share of the side's contrast: rows with less have no edge or are covered.
constexpr double k_min_share = 0.2;
constexpr double k_end_px = 3;           // a corner is visible when most rows this near to it are on the line
constexpr double k_end_share = 0.1;      // or within this share of the side
constexpr double k_min_scale_px = 0.04;  // smaller residuals are no reason to reject
constexpr double k_consensus_px = 0.2;   // typical residual of crossings on one line
constexpr int k_min_crossings = 3;
// A side's own correlation counts with this factor beside the mean of all sides, which is known better.
constexpr double k_own_correlation = 1.0 / 3;
constexpr std::size_t k_min_bent_crossings = 12;
// A smaller bow is treated as noise: one straight side in 370 shows as much.
constexpr double k_bow_deviations = 3;
// Largest bow in half a side: paper around a cylinder eight sides wide, seen along its edge (sagitta half^2 /
// 2R). With half as much again, the corner lies elsewhere.
constexpr double k_max_bow_share = 0.0625;
constexpr double k_no_bow_factor = 1.5;
// Sides with a larger bow than the first of these shares are fitted as curves, and so are the sides opposite
// to them; the largest bow of a curve is that of a cylinder of a radius of .8 sides, tilted by 45 degrees.
// Shorter sides show too little of it.
constexpr double k_min_curve_bow_share = 0.02, k_max_curve_bow_share = 0.22;
constexpr std::size_t k_min_curve_crossings = 24;
constexpr double k_sharp_half = 12;  // half a side, in its blur: other edges bend more blurred sides
// Standard deviation of the terms of third and fourth order, at half a side: a share of the bow; less where
// the bow is a smaller share of half the side than this.
constexpr double k_curve_share = 0.1, k_curved_bow_share = 0.06;
// Standard deviation of a bent side's place, as share of its bow, and the bow's share of half the side at
// which it is twice as large: measured on cylinders.
constexpr double k_bow_doubt = 0.006, k_strong_bow_share = 0.1;
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

constexpr double k_bow_evidence = k_bow_deviations * k_bow_deviations;

struct Belief {
  double share;        // share of the bow that is applied
  double probability;  // probability that there is a bow
};

// The share is the non-negative garrote (Breiman 1995), 1 - (k s / b)^2 for a bow b with standard deviation
// s. It grows steadily with the evidence, so that a corner does not jump between frames whose evidence lies
// on either side of a limit; a clear bow keeps its whole size. The probability is one half at that limit.
Belief belief_in_bow(const EdgeRefiner::EdgeLine& bent) {
  const double most = bent.is_curved ? k_max_curve_bow_share : k_max_bow_share;
  const double plausible =
      std::clamp((k_no_bow_factor * most - bent.bow_share()) / ((k_no_bow_factor - 1) * most), 0.0, 1.0);
  if (bent.curvature == 0) return {0, 0};  // exactly 0, with a covariance of 0
  const double evidence = bent.curvature * bent.curvature / bent.covariance(2, 2);
  return {plausible * std::max(0.0, 1 - k_bow_evidence / evidence),
          plausible / (1 + std::exp(0.5 * (k_bow_evidence - evidence)))};
}

// The weighted mean of both lines. Its covariance includes the expected square error if either line is the
// true one.
EdgeRefiner::EdgeLine averaged(const EdgeRefiner::EdgeLine& straight,
                               const EdgeRefiner::EdgeLine& bent,
                               const Belief& belief) {
  const auto& [share, probability] = belief;
  EdgeRefiner::EdgeLine line = straight;
  const EdgeRefiner::EdgeLine::Terms apart = bent.terms() - straight.terms();
  line.offset += share * apart[0];
  line.slope += share * apart[1];
  line.curvature += share * apart[2];
  line.third += share * apart[3];
  line.fourth += share * apart[4];
  const double off = probability * (1 - share) * (1 - share) + (1 - probability) * share * share;
  line.covariance =
      (1 - share) * straight.covariance + share * bent.covariance + off * apart * apart.transpose();
  return line;
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

// Where some rows lie in shadow, rescales the shares to the contrast of the rows in light.
void EdgeRefiner::settle_shares(Effort effort) {
  double sum = 0;
  double count = 0;
  if (effort == Effort::full)
    for (const double share : crossings_.share) {
      sum += share >= 1 ? share : 0;
      count += share >= 1 ? 1 : 0;
    }
  const double scale = count > 0 ? count / sum : 1;
  for (double& share : crossings_.share) share = std::min(1.0, share * scale);
}

// Fits a straight and a bent line, and averages them by the evidence for a bow. `is_curved`: the round
// before showed a curve.
bool EdgeRefiner::fit_line(Effort effort, Sides sides, bool is_curved, EdgeLine* line, double* variance) {
  double u_sum = 0;
  for (const double u : crossings_.u) u_sum += u;
  line->u_middle = u_sum / static_cast<double>(crossings_.u.size());
  crossings_.d.resize(crossings_.u.size());
  crossings_.residual.resize(crossings_.u.size());
  for (std::size_t i = 0; i < crossings_.u.size(); ++i) crossings_.d[i] = crossings_.u[i] - line->u_middle;
  line->half = 0.5 * std::abs(crossings_.u.back() - crossings_.u.front());
  const bool covered = sides == Sides::covered;
  if (covered) find_consensus(line);
  *variance = fit_terms(2, covered, line);
  if (!(*variance >= 0)) return false;
  line->bent_terms.setZero();
  line->is_curved = is_curved && crossings_.u.size() >= k_min_curve_crossings;
  if (covered || effort == Effort::rough || crossings_.u.size() < k_min_bent_crossings) return true;
  EdgeLine bent = *line;
  if (!(fit_terms(3, false, &bent) >= 0)) return true;
  if (crossings_.u.size() >= k_min_curve_crossings &&
      bent.curvature * bent.curvature > k_bow_evidence * bent.covariance(2, 2))
    line->bent_terms = bent.terms();
  const Belief belief = belief_in_bow(bent);
  if (bent.is_curved && belief.share > 0) {
    EdgeLine curve = bent;
    if (fit_curve(variance, &curve)) bent = curve;
  }
  *line = averaged(*line, bent, belief);
  if (line->is_curved) {
    const double doubt_px = k_bow_doubt * line->bow_px() * (1 + line->bow_share() / k_strong_bow_share);
    line->covariance(0, 0) += doubt_px * doubt_px;
  }
  return true;
}

struct Sums {  // weighted sums over the crossings: powers of d, and products of v with them
  double w = 0, wd = 0, wdd = 0, wddd = 0, wdddd = 0, v = 0, vd = 0, vdd = 0;
};

// Huber weights beyond `huber`, zero weight beyond `foreign`.
LIMN_SIMD Sums weighted_sums(const double* __restrict d,
                             const double* __restrict v,
                             const double* __restrict share,
                             const double* __restrict residual,
                             std::size_t count,
                             double huber,
                             double foreign) {
  double w0 = 0, w1 = 0, w2 = 0, w3 = 0, w4 = 0, v0 = 0, v1 = 0, v2 = 0;
#pragma omp simd reduction(+ : w0, w1, w2, w3, w4, v0, v1, v2)
  for (std::size_t i = 0; i < count; ++i) {
    const double bounded = residual[i] > huber ? huber / residual[i] : 1.0;
    const double w = share[i] * share[i] * (residual[i] > foreign ? 0.0 : bounded);
    const double wd = w * d[i];
    const double wdd = wd * d[i];
    const double wddd = wdd * d[i];
    w0 += w, w1 += wd, w2 += wdd, w3 += wddd, w4 += wddd * d[i];
    v0 += w * v[i], v1 += wd * v[i], v2 += wdd * v[i];
  }
  return {w0, w1, w2, w3, w4, v0, v1, v2};
}

struct Spread {  // sums over residuals that are not foreign
  double squares = 0, count = 0, largest = 0;
};

LIMN_SIMD Spread new_residuals(const double* __restrict d,
                               const double* __restrict v,
                               const double* __restrict share,
                               std::size_t count,
                               const Eigen::Vector3d& line,
                               double bound,
                               double foreign,
                               double* __restrict residual) {
  const double offset = line[0], slope = line[1], curvature = line[2];
  double squares = 0, kept = 0, largest = 0;
#pragma omp simd reduction(+ : squares, kept) reduction(max : largest)
  for (std::size_t i = 0; i < count; ++i) {
    const double r = share[i] * std::abs(v[i] - (offset + d[i] * (slope + d[i] * curvature)));
    residual[i] = r;
    const double counts = r > foreign ? 0.0 : 1.0;
    const double bounded = counts * (r > bound ? bound : r);
    squares += bounded * bounded;
    kept += counts;
    largest = counts * r > largest ? counts * r : largest;
  }
  return {squares, kept, largest};
}

constexpr std::size_t k_few = 64;

// The median of at most k_few values that are not negative. All are compared with all, so that there are no
// mispredicted branches.
LIMN_SIMD float median_of_few(const float* __restrict values, std::size_t count) {
  std::array<float, k_few> lanes;
  std::array<std::int32_t, k_few> smaller{};
  for (std::size_t k = 0; k < k_few; ++k)
    lanes[k] = k < count ? values[k] : std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < count; ++i) {
    const float value = values[i];
    for (std::size_t k = 0; k < k_few; ++k) smaller[k] += value < lanes[k] ? 1 : 0;
  }
  const auto rank = static_cast<std::int32_t>(count / 2);
  float middle = 0;
#pragma omp simd reduction(max : middle)
  for (std::size_t k = 0; k < k_few; ++k) {
    const float value = smaller[k] <= rank ? lanes[k] : 0;
    middle = value > middle ? value : middle;
  }
  return middle;
}

float median_of_sizes(std::vector<float>* values) {
  if (values->size() <= k_few) return median_of_few(values->data(), values->size());
  return value_of_rank(values, values->size() / 2);
}

// The line through two crossings that most other crossings lie on. A least-squares start would lie between a
// side's own edge and the edge of an object that partly covers it (Torr and Zisserman 2000, "MLESAC").
void EdgeRefiner::find_consensus(EdgeLine* line) {
  constexpr std::size_t k_anchors = 9;
  const std::size_t count = crossings_.u.size();
  const std::size_t anchors = std::min(count, k_anchors);
  const auto at = [&](std::size_t i) { return i * (count - 1) / (anchors - 1); };
  double least = std::numeric_limits<double>::infinity();
  line->curvature = 0;
  for (std::size_t i = 0; i < anchors; ++i)
    for (std::size_t j = i + 1; j < anchors; ++j) {
      const double run = crossings_.d[at(j)] - crossings_.d[at(i)];
      if (std::abs(run) < 0.2 * std::abs(crossings_.d.back() - crossings_.d.front())) continue;
      const double slope = (crossings_.v[at(j)] - crossings_.v[at(i)]) / run;
      const double offset = crossings_.v[at(i)] - slope * crossings_.d[at(i)];
      const double bound = 3 * k_consensus_px;
      const Spread spread = new_residuals(
          crossings_.d.data(), crossings_.v.data(), crossings_.share.data(), count, {offset, slope, 0}, bound,
          std::numeric_limits<double>::infinity(), crossings_.residual.data());
      if (spread.squares >= least) continue;
      least = spread.squares;
      line->offset = offset;
      line->slope = slope;
    }
}

// Weighted least squares of the first `terms` of offset, slope and curvature; then with Huber weights at the
// residuals' robust scale; then without crossings that belong to something else. Returns the residuals'
// variance, which is negative when the crossings do not determine the terms. With `from_line` it starts from
// the given line and rejects at once.
double EdgeRefiner::fit_terms(int terms, bool from_line, EdgeLine* line) {
  constexpr double k_all = std::numeric_limits<double>::infinity();
  constexpr int k_huber_rounds = 3;
  constexpr int k_rounds = 5;
  const std::size_t count = crossings_.u.size();
  const double* d = crossings_.d.data();
  const double* v = crossings_.v.data();
  const double* share = crossings_.share.data();
  double* residual = crossings_.residual.data();
  double scale = 0;  // 0: no robust weights yet
  double variance = -1;
  const double half = line->half;
  if (from_line) {
    const Eigen::Vector3d start(line->offset, line->slope, line->curvature);
    new_residuals(d, v, share, count, start, k_all, k_all, residual);
    scale = k_consensus_px;
  } else {
    line->offset = line->slope = line->curvature = line->third = line->fourth = 0;
    std::fill_n(residual, count, 0.0);
  }
  for (int round = 0; round < k_rounds; ++round) {
    const bool rejecting = from_line || round >= k_huber_rounds;
    const double foreign = rejecting ? k_reject * std::max(scale, k_min_scale_px) : k_all;
    const Sums sums =
        weighted_sums(d, v, share, residual, count, scale > 0 ? k_huber * scale : k_all, foreign);
    Eigen::Matrix3d normal;
    normal << sums.w, sums.wd, sums.wdd, sums.wd, sums.wdd, sums.wddd, sums.wdd, sums.wddd, sums.wdddd;
    Eigen::Vector3d right(sums.v, sums.vd, sums.vdd);
    if (terms == 2) {
      normal.row(2).setZero();
      normal.col(2).setZero();
      normal(2, 2) = 1;
      right[2] = 0;
    }
    if (!(normal.determinant() > 1e-9 * normal(0, 0) * normal(0, 0) * normal(2, 2))) return -1;
    Eigen::Matrix3d inverse = normal.inverse();
    const Eigen::Vector3d solution = inverse * right;
    const double moved = std::abs(solution[0] - line->offset) + half * std::abs(solution[1] - line->slope) +
                         half * half * std::abs(solution[2] - line->curvature);
    line->offset = solution[0];
    line->slope = solution[1];
    line->curvature = solution[2];
    if (terms == 2) inverse(2, 2) = 0;
    const Spread spread =
        new_residuals(d, v, share, count, solution, scale > 0 ? 3 * scale : k_all, foreign, residual);
    variance = spread.squares / std::max(1.0, spread.count - terms);  // for a row with full contrast
    line->covariance.setZero();
    line->covariance.topLeftCorner<3, 3>() = inverse * variance;
    // The fit has converged and later rounds have nothing to reject.
    if (round > 0 && moved < k_settled_px && spread.largest < k_reject * std::max(scale, k_min_scale_px))
      break;
    if (round + 1 == k_rounds) break;
    deviations_.resize(count);
    std::transform(residual, residual + count, deviations_.begin(),
                   [](double deviation) { return static_cast<float>(deviation); });
    scale = std::max(1.4826 * median_of_sizes(&deviations_), 1e-3);
  }
  return variance;
}

// Weighted least squares of all five terms, with robust weights, starting from a bent line. The terms of
// third and fourth order are expected to be as large as those of a cylinder in perspective, a share of the
// bow (ridge regression), so that they do no harm where the crossings do not show them. False when the
// crossings do not determine the terms.
bool EdgeRefiner::fit_curve(double* variance, EdgeLine* line) {
  constexpr int k_huber_rounds = 3;
  constexpr int k_rounds = 5;
  using Matrix = Eigen::Matrix<double, 5, 5>;
  using Terms = EdgeLine::Terms;
  const std::size_t count = crossings_.u.size();
  const auto row_of = [&](std::size_t i) {
    const double t = crossings_.d[i] / line->half;
    Terms row;
    row << 1, t, t * t, t * t * t, t * t * t * t;
    return row;
  };
  Terms scales;  // the terms for d are those for t times these
  scales << 1, 1 / line->half, 0, 0, 0;
  for (int i = 2; i < 5; ++i) scales[i] = scales[i - 1] * scales[1];
  Terms terms = line->terms().cwiseQuotient(scales);
  const double expected_px =
      k_curve_share * line->bow_px() * std::min(1.0, line->bow_share() / k_curved_bow_share);
  Matrix covariance;
  for (int round = 0; round < k_rounds; ++round) {
    deviations_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double size = crossings_.share[i] * std::abs(crossings_.v[i] - row_of(i).dot(terms));
      crossings_.residual[i] = size;
      deviations_[i] = static_cast<float>(size);
    }
    const double scale = std::max(1.4826 * median_of_sizes(&deviations_), 1e-3);
    const double foreign = round < k_huber_rounds ? std::numeric_limits<double>::infinity()
                                                  : k_reject * std::max(scale, k_min_scale_px);
    Matrix normal = Matrix::Zero();
    Terms right = Terms::Zero();
    for (std::size_t i = 0; i < count; ++i) {
      const double r = crossings_.residual[i];
      if (r > foreign) continue;
      const double bounded = r > k_huber * scale ? k_huber * scale / r : 1.0;
      const double w = crossings_.share[i] * crossings_.share[i] * bounded;
      const Terms row = row_of(i);
      normal += w * row * row.transpose();
      right += w * crossings_.v[i] * row;
    }
    const double expected = std::max(*variance, 1e-6) / std::max(expected_px * expected_px, 1e-9);
    normal(3, 3) += expected, normal(4, 4) += expected;
    const Eigen::LDLT<Matrix> solver(normal);
    terms = solver.solve(right);
    if (!terms.allFinite() || !(solver.vectorD().minCoeff() > 1e-6 * normal(0, 0))) return false;
    double squares = 0, kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (crossings_.residual[i] > foreign) continue;
      const double r = crossings_.share[i] * (crossings_.v[i] - row_of(i).dot(terms));
      squares += std::min(r * r, 9 * scale * scale);
      ++kept;
    }
    *variance = squares / std::max(1.0, kept - 5);
    covariance = *variance * solver.solve(Matrix::Identity());
  }
  terms = terms.cwiseProduct(scales);
  line->covariance = scales.asDiagonal() * covariance * scales.asDiagonal();
  line->offset = terms[0], line->slope = terms[1], line->curvature = terms[2];
  line->third = terms[3], line->fourth = terms[4];
  return true;
}

// Ratio by which the line's variance grows because the errors of neighbouring crossings are correlated,
// through print, paper, shadows and JPEG. From sums of residuals over blocks (the "sandwich", Liang and Zeger
// 1986).
double EdgeRefiner::correlation_along(const EdgeLine& line, double variance) const {
  constexpr std::size_t k_blocks = 10;
  constexpr std::size_t k_least_rows = 4;
  const std::size_t count = crossings_.u.size();
  const std::size_t rows = std::max(k_least_rows, (count + k_blocks - 1) / k_blocks);
  const double blocks = static_cast<double>(count) / static_cast<double>(rows);
  const double terms = line.curvature == 0 ? 2 : line.fourth == 0 ? 3 : 5;
  if (blocks < terms + 1) return 1;
  const double bound = k_reject * std::sqrt(variance);
  double together = 0;
  double alone = 0;
  for (std::size_t first = 0; first < count; first += rows) {
    double sum = 0;
    for (std::size_t i = first; i < std::min(count, first + rows); ++i) {
      const double r = crossings_.share[i] * (crossings_.v[i] - line.at(crossings_.u[i]));
      if (std::abs(r) > bound) continue;
      sum += r;
      alone += r * r;
    }
    together += sum * sum;
  }
  const auto number = static_cast<double>(count);
  return together / (blocks - terms) * blocks / (alone / (number - terms) * number);
}

// Whether most rows next to the side's ends lie on the line. Rows nearer than `trim` to an end have no
// crossings.
void EdgeRefiner::find_ends(double from, double to, double trim, double variance, EdgeLine* line) const {
  const double band = std::max(k_end_px, k_end_share * std::abs(to - from));
  const double near = k_reject * std::max(k_min_scale_px, std::sqrt(variance));
  double at_from = 0;
  double at_to = 0;
  for (std::size_t i = 0; i < crossings_.u.size(); ++i) {
    const double u = crossings_.u[i];
    if (crossings_.share[i] * std::abs(crossings_.v[i] - line->at(u)) > near) continue;
    at_from += std::abs(u - from) < trim + band;
    at_to += std::abs(u - to) < trim + band;
  }
  line->seen_at_start = at_from >= 0.5 * band;
  line->seen_at_end = at_to >= 0.5 * band;
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
