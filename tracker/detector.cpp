#include "tracker/detector.h"

#include <algorithm>
#include <utility>

namespace limn::tracker {
namespace {

double longest_side(const Detection& detection) {
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i)
    longest = std::max(longest, (detection.corners_px[i] - detection.corners_px[(i + 1) % 4]).norm());
  return longest;
}

double shortest_side(const Quad& quad) {
  double shortest = (quad.corners_px[0] - quad.corners_px[3]).norm();
  for (std::size_t i = 0; i < 3; ++i)
    shortest = std::min(shortest, (quad.corners_px[i + 1] - quad.corners_px[i]).norm());
  return shortest;
}

Eigen::Vector2d centre(const Detection& detection) {
  const auto& c = detection.corners_px;
  return 0.25 * (c[0] + c[1] + c[2] + c[3]);
}

// Two readings of one black square.
bool is_same_square(const Detection& a, const Detection& b) {
  return (centre(a) - centre(b)).norm() < 0.15 * std::min(longest_side(a), longest_side(b));
}

void add_best_of_square(Detection detection, std::vector<Detection>* detections) {
  for (Detection& other : *detections) {
    if (!is_same_square(detection, other)) continue;
    if (detection.score > other.score) other = std::move(detection);
    return;
  }
  detections->push_back(std::move(detection));
}

constexpr double k_refined_contrast = 0.7;  // share of min_contrast that an edge must keep on average

constexpr double k_rough_above_px = 32;  // smaller quads are refined in full at once: it costs as little

constexpr double k_fit_above_px = 24;  // smaller markers have too few pixels for the fit

// Error of a corner whose edges overlap, in their blur: measured on sigma 2.5 to 3.5 and motion of 8 to 16
// px.
constexpr double k_overlap_doubt = 0.15;

// Whether a marker found before takes the place.
bool is_taken(const Quad& quad, const std::vector<Detection>& detections) {
  const auto& q = quad.corners_px;
  const Eigen::Vector2d middle = 0.25 * (q[0] + q[1] + q[2] + q[3]);
  return std::any_of(detections.begin(), detections.end(),
                     [&](const Detection& d) { return (centre(d) - middle).norm() < 0.5 * longest_side(d); });
}

}  // namespace

std::vector<Detection> Detector::detect(const cv::Mat& grey, const Lens* lens) {
  LIMN_CHECK(grey.empty() || grey.type() == CV_8UC1);
  std::vector<Detection> detections;
  if (grey.empty()) return detections;
  threshold_.apply(grey, options_.min_contrast, corner_codes_);
  finder_.find(corner_codes_, {options_.min_side_px}, quads_);
  for (const Quad& quad : quads_)
    if (auto found = read(grey, quad, lens, Reading::open))
      add_best_of_square(std::move(*found), &detections);
  if (options_.broken_markers) add_broken(grey, lens, &detections);
  return detections;
}

std::optional<Detection> Detector::read(const cv::Mat& grey,
                                        const Quad& quad,
                                        const Lens* lens,
                                        Reading reading) {
  if (!may_be_marker(grey, quad, options_.min_contrast)) return std::nullopt;
  const bool covered = reading == Reading::covered;
  if (covered && !may_be_covered_code(grey, quad)) return std::nullopt;
  const double min_contrast = k_refined_contrast * options_.min_contrast;
  std::optional<RefinedQuad> rough;
  if (covered || shortest_side(quad) > k_rough_above_px) {
    rough = refiner_.refine(grey, quad, min_contrast, lens, Effort::rough);
    if (!rough || !identify(grey, *rough, families_, reading)) return std::nullopt;
  }
  auto refined =
      refiner_.refine(grey, rough ? Quad{rough->corners_px} : quad, min_contrast, lens, Effort::full);
  if (!refined) refined = rough;
  if (!refined) return std::nullopt;
  const auto identity = identify(grey, *refined, families_, reading);
  if (!identity) return std::nullopt;
  if (!refined->separate) settle_overlapping_edges(grey, *identity, &*refined);
  Detection detection;
  detection.marker = identity->marker;
  detection.score = std::clamp(identity->score, 0.0, 1.0);
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t corner = (i + identity->first_corner) % 4;
    detection.corners_px[i] = refined->corners_px[corner];
    detection.corner_covariance[i] = refined->corner_covariance[corner];
    detection.corner_visible[i] = refined->corner_visible[corner];
  }
  return detection;
}

// Edges whose blur overlaps with others': by the whole pattern, or else with the doubt that they deserve.
void Detector::settle_overlapping_edges(const cv::Mat& grey,
                                        const Identity& identity,
                                        RefinedQuad* refined) const {
  const double blur_px = *std::max_element(refined->blur_px.begin(), refined->blur_px.end());
  const bool may_fit = identity.cells.count > 0 && shortest_side(Quad{refined->corners_px}) > k_fit_above_px;
  if (may_fit)
    if (auto fitted = fit_pattern(grey, refiner_.light(), *refined, identity.cells)) {
      *refined = *fitted;
      return;
    }
  const double doubt_px = k_overlap_doubt * blur_px;
  for (Eigen::Matrix2d& covariance : refined->corner_covariance)
    covariance += doubt_px * doubt_px * Eigen::Matrix2d::Identity();
}

void Detector::add_broken(const cv::Mat& grey, const Lens* lens, std::vector<Detection>* detections) {
  constexpr std::size_t k_max_candidates = 400;
  known_.clear();
  for (const Detection& detection : *detections) known_.push_back(detection.corners_px);
  segment_finder_.find(grey, options_.min_contrast, known_, segments_);
  joiner_.find(segments_, grey.cols, grey.rows, joined_);
  const std::size_t regular = detections->size();
  for (std::size_t i = 0; i < std::min(joined_.size(), k_max_candidates); ++i) {
    Quad quad = joined_[i].quad;
    quad.within_px = 5;
    if (is_taken(quad, {detections->begin(), detections->begin() + static_cast<std::ptrdiff_t>(regular)}))
      continue;
    if (auto found = read(grey, quad, lens, Reading::covered))
      add_best_of_square(std::move(*found), detections);
  }
}

}  // namespace limn::tracker
