#include "tracker/edge_bleed.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "tracker/quad_sampler.h"

namespace limn::tracker {
namespace {

constexpr std::size_t k_steps = 8;                    // samples from one cell's middle to the next
constexpr std::array<float, 2> k_lines{-0.2F, 0.2F};  // sample lines, in cells beside a cell's middle
constexpr int k_min_edges = 12;
constexpr double k_min_contrast = 8;  // light, between two cells
// A smaller bleed is treated as noise, as curvature is in edge_line_fit.cpp.
constexpr double k_clear_deviations = 3;
constexpr double k_unsure_share = 0.2;         // share of the bleed: photographs of boards agree up to it
constexpr double k_between_markers_px = 0.02;  // smallest standard deviation between an image's markers

// Edges between neighbouring cells in x, or in y if `down`: direction, polarity, and the places of their
// samples.
struct Edges {
  static constexpr std::size_t k_most = 2 * SeenCells::k_max * (SeenCells::k_max - 1);
  static constexpr std::size_t k_places = k_lines.size() * (k_steps + 1);
  std::size_t count = 0;
  std::array<double, k_most> leverage;  // factor of the bleed in the measured width of white
  std::array<bool, k_most> rising, down;
  std::array<double, k_most> place, line;  // along and across its direction, from -1 to 1
  std::array<float, k_most * k_places> x, y;
};

void add_edges(const SeenCells& cells, bool down, Edges* edges) {
  const auto number = static_cast<float>(cells.count);
  for (int line = 0; line < cells.count; ++line)
    for (int i = 0; i + 1 < cells.count; ++i) {
      const bool first = down ? cells.is_white(i, line) : cells.is_white(line, i);
      const bool second = down ? cells.is_white(i + 1, line) : cells.is_white(line, i + 1);
      if (first == second) continue;
      // The corners have drawn back, too, so the edge seems nearer to the border than it is. White on an
      // edge's inner side seems wider for both reasons; on its outer side the two effects have opposite
      // signs.
      const double from_middle = 2 * (i + 1.0) / cells.count - 1;
      edges->leverage[edges->count] = 1 + (first ? from_middle : -from_middle);
      edges->place[edges->count] = from_middle;
      edges->line[edges->count] = (2 * line + 1.0) / cells.count - 1;
      edges->rising[edges->count] = second;
      edges->down[edges->count] = down;
      std::size_t at = edges->count++ * Edges::k_places;
      for (const float beside : k_lines)
        for (std::size_t step = 0; step <= k_steps; ++step, ++at) {
          const float along =
              (static_cast<float>(i) + 0.5F + static_cast<float>(step) / static_cast<float>(k_steps)) /
              number;
          const float across = (static_cast<float>(line) + 0.5F + beside) / number;
          edges->x[at] = down ? across : along;
          edges->y[at] = down ? along : across;
        }
    }
}

// The bleed, and displacements of the cells that bent paper causes in each of both directions: towards or
// away from the middle, along, and as a bow.
constexpr int k_bent_terms = 7;
// Ratio of variances (F with 6 and some 40 degrees of freedom): flat paper reaches it once in 10 000 times.
constexpr double k_bent_evidence = 6;
constexpr double k_flat_residual_px = 0.1;  // with smaller residuals the cells of flat paper are not bent
using BentTerms = Eigen::Matrix<double, k_bent_terms, 1>;
using BentMatrix = Eigen::Matrix<double, k_bent_terms, k_bent_terms>;

BentTerms bent_terms(const Edges& edges, std::size_t i) {
  BentTerms terms = BentTerms::Zero();
  terms[0] = edges.leverage[i];
  const double sign = edges.rising[i] ? -1 : 1, x = edges.place[i], y = edges.line[i];
  terms.segment<3>(edges.down[i] ? 4 : 1) = sign * Eigen::Vector3d(1 - x * x, x * (1 - x * x), 1 - y * y);
  return terms;
}

// The mean of the bleed of flat paper and that of bent paper, by the evidence for bent paper, so that corners
// do not jump as paper bends. `squares`: the sum of squared residuals of flat paper. `wider`: the measured
// widening of white at each edge, NaN where the edge does not show.
EdgeBleed bleed_of_bent_paper(const Edges& edges,
                              std::span<const double> wider,
                              const EdgeBleed& flat,
                              double squares) {
  BentMatrix normal = BentMatrix::Zero();
  BentTerms right = BentTerms::Zero();
  double squares_of_all = 0;
  int freedom = -k_bent_terms;
  for (std::size_t i = 0; i < edges.count; ++i) {
    if (std::isnan(wider[i])) continue;
    const BentTerms terms = bent_terms(edges, i);
    normal += terms * terms.transpose();
    right += wider[i] * terms;
    squares_of_all += wider[i] * wider[i];
    ++freedom;
  }
  if (freedom < k_bent_terms) return flat;
  const Eigen::LDLT<BentMatrix> solver(normal);
  if (!(solver.vectorD().minCoeff() > 1e-3)) return flat;
  const BentTerms terms = solver.solve(right);
  const BentTerms first = solver.solve(BentTerms::Unit(0));
  const double variance = std::max(1e-9, squares_of_all - right.dot(terms)) / freedom;
  const double evidence = (squares - variance * freedom) / ((k_bent_terms - 1) * variance);
  if (!(evidence > k_bent_evidence)) return flat;
  const double share = 1 - k_bent_evidence / evidence;
  return {(1 - share) * flat.px + share * terms[0],
          (1 - share) * flat.variance + share * variance * first[0]};
}

}  // namespace

std::optional<EdgeBleed> find_edge_bleed(const cv::Mat& grey,
                                         const std::array<double, 256>& light,
                                         const std::array<Eigen::Vector2d, 4>& corners_px,
                                         const SeenCells& cells) {
  Edges edges;
  add_edges(cells, false, &edges);
  add_edges(cells, true, &edges);
  if (edges.count < static_cast<std::size_t>(k_min_edges)) return std::nullopt;
  std::array<float, Edges::k_most * Edges::k_places> levels;
  const QuadSampler quad(grey, corners_px);
  const std::size_t places = edges.count * Edges::k_places;
  for (std::size_t from = 0; from < places; from += QuadSampler::k_most) {
    const std::size_t number = std::min(QuadSampler::k_most, places - from);
    quad.between({&edges.x[from], number}, {&edges.y[from], number}, &levels[from]);
  }
  const auto& c = corners_px;
  const auto cross = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return std::abs(a.x() * b.y() - a.y() * b.x());
  };
  const double area = 0.5 * cross(c[2] - c[0], c[3] - c[1]);
  const double width = area / (0.5 * ((c[3] - c[0]).norm() + (c[2] - c[1]).norm()));
  const double height = area / (0.5 * ((c[1] - c[0]).norm() + (c[2] - c[3]).norm()));
  const auto light_at = [&](std::size_t place) {
    return light[static_cast<std::size_t>(std::clamp(levels[place] + 0.5F, 0.0F, 255.0F))];
  };
  // a: leverage; b: width of white minus half the distance between the middles, px
  double aa = 0, ab = 0, bb = 0;
  int number = 0;
  std::array<double, Edges::k_most> wider;  // b of each edge; NaN where it does not show
  for (std::size_t i = 0; i < edges.count; ++i) {
    const double cell_px = (edges.down[i] ? height : width) / cells.count;
    double white = 0;  // share of white on the way, mean over the lines
    bool shows = true;
    for (std::size_t line = 0; line < k_lines.size(); ++line) {
      const std::size_t at = i * Edges::k_places + line * (k_steps + 1);
      const double begins = light_at(at), ends = light_at(at + k_steps);
      const double rise = edges.rising[i] ? ends - begins : begins - ends;
      shows &= rise > k_min_contrast;
      double sum = 0.5 * (begins + ends);
      for (std::size_t step = 1; step < k_steps; ++step) sum += light_at(at + step);
      white += (sum / k_steps - std::min(begins, ends)) / rise / k_lines.size();
    }
    wider[i] = std::numeric_limits<double>::quiet_NaN();
    if (!shows) continue;
    const double a = edges.leverage[i], b = (white - 0.5) * cell_px;
    aa += a * a, ab += a * b, bb += b * b;
    wider[i] = b;
    ++number;
  }
  if (number < k_min_edges) return std::nullopt;
  const double squares = std::max(0.0, bb - ab * ab / aa);
  const EdgeBleed flat{ab / aa, squares / (number - 1) / aa};
  if (squares <= k_flat_residual_px * k_flat_residual_px * number) return flat;
  return bleed_of_bent_paper(edges, wider, flat, squares);
}

std::optional<EdgeBleed> common_edge_bleed(std::span<const EdgeBleed> of_markers) {
  if (of_markers.empty()) return std::nullopt;
  double weights = 0, sum = 0, squares = 0;
  for (const EdgeBleed& one : of_markers) {
    const double weight = 1 / (one.variance + k_between_markers_px * k_between_markers_px);
    weights += weight, sum += weight * one.px, squares += weight * one.px * one.px;
  }
  const double mean = sum / weights;
  const auto others = static_cast<double>(of_markers.size() - 1);
  const double scatter = others > 0 ? std::max(1.0, (squares - mean * sum) / others) : 1;
  return EdgeBleed{mean, scatter / weights};
}

void undo_edge_bleed(const EdgeBleed& bleed,
                     std::array<Eigen::Vector2d, 4>* corners_px,
                     std::array<Eigen::Matrix2d, 4>* covariance) {
  const double square = bleed.px * bleed.px;
  constexpr double k_limit = k_clear_deviations * k_clear_deviations;
  const double evidence = square / bleed.variance;
  if (!(evidence > 0)) return;
  // The non-negative garrote, and its expected square error, whether there is a bleed or none; as for
  // curvature in edge_line_fit.cpp.
  const double share = std::max(0.0, 1 - k_limit / evidence);
  const double probability = 1 / (1 + std::exp(0.5 * (k_limit - evidence)));
  const double off = probability * (1 - share) * (1 - share) + (1 - probability) * share * share;
  const double unsure =
      share * bleed.variance + (off + share * share * k_unsure_share * k_unsure_share) * square;
  const std::array<Eigen::Vector2d, 4> before = *corners_px;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d to_here = (before[i] - before[(i + 3) % 4]).normalized();
    const Eigen::Vector2d from_here = (before[(i + 1) % 4] - before[i]).normalized();
    const Eigen::Vector2d outward[2] = {{to_here.y(), -to_here.x()}, {from_here.y(), -from_here.x()}};
    // Moving both sides out by a pixel moves their corner by `out`.
    const Eigen::Vector2d out = (outward[0] + outward[1]) / (1 + outward[0].dot(outward[1]));
    if (!out.allFinite()) continue;
    (*corners_px)[i] += share * bleed.px * out;
    (*covariance)[i] += unsure * out * out.transpose();
  }
}

}  // namespace limn::tracker
