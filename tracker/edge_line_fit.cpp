// The fit of a side's line to its crossings.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/median.h"
#include "tracker/refine.h"
#include "tracker/simd.h"

namespace limn::tracker {
namespace {

constexpr double k_settled_px = 2e-3;
constexpr double k_huber = 1.5;          // in robust standard deviations
constexpr double k_reject = 4;           // in the same unit: crossings beyond it belong to something else
constexpr double k_end_px = 3;           // a corner is visible when most rows this near to it are on the line
constexpr double k_end_share = 0.1;      // or within this share of the side
constexpr double k_min_scale_px = 0.04;  // smaller residuals are no reason to reject
constexpr double k_consensus_px = 0.2;   // typical residual of crossings on one line
constexpr std::size_t k_min_bent_crossings = 12;
// A smaller bow is treated as noise: one straight side in 370 shows as much.
constexpr double k_bow_deviations = 3;
// Largest bow in half a side: paper around a cylinder eight sides wide, seen along its edge (sagitta half^2 /
// 2R). With half as much again, the corner lies elsewhere.
constexpr double k_max_bow_share = 0.0625;
constexpr double k_no_bow_factor = 1.5;
// The largest bow of a curve is that of a cylinder of a radius of .8 sides, tilted by 45 degrees.
constexpr double k_max_curve_bow_share = 0.22;
constexpr std::size_t k_min_curve_crossings = 24;
// Standard deviation of the terms of third and fourth order, at half a side: a share of the bow; less where
// the bow is a smaller share of half the side than this.
constexpr double k_curve_share = 0.1, k_curved_bow_share = 0.06;
// Standard deviation of a bent side's place, as share of its bow, and the bow's share of half the side at
// which it is twice as large: measured on cylinders.
constexpr double k_bow_doubt = 0.006, k_strong_bow_share = 0.1;

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

}  // namespace limn::tracker
