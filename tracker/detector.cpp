#include "tracker/detector.h"

#include <algorithm>
#include <atomic>
#include <functional>
#include <mutex>
#include <utility>

#include "tracker/quad_check.h"
#include "tracker/shadow_edges.h"

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

constexpr double k_around_region_px = 8;  // surroundings of a marker, for the threshold

// Whether two readings are of the same black square.
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

constexpr double k_refined_contrast = 0.7;  // share of min_contrast that a refined edge must have on average

constexpr double k_rough_above_px = 32;  // smaller quads are refined in full at once, which costs no more

constexpr double k_fit_above_px = 12;  // smaller markers have too few pixels for the fit

// Cells narrower than this many sigmas of the blur lie within each other's edges.
constexpr double k_cell_sigmas = 5;
// In cells narrower than this many sigmas, the middle is no longer black or white, so edge bleed is not
// measured.
constexpr double k_retreat_sigmas = 3.5;

// Error of a corner whose edges overlap, as a share of their blur; measured with sigma 2.5 to 3.5 and motion
// of 8 to 16 px.
constexpr double k_overlap_doubt = 0.15;

double blur_of(const RefinedQuad& quad) {
  return *std::max_element(quad.blur_px.begin(), quad.blur_px.end());
}

bool is_blurred(const RefinedQuad& quad, const SeenCells& cells, double cell_sigmas) {
  return shortest_side(Quad{quad.corners_px}) < cell_sigmas * blur_of(quad) * cells.count;
}

// Sides with a larger bow belong to paper that is bent: its cells do not lie where those of flat paper do,
// and the fit of the whole pattern describes a smaller bow only.
constexpr double k_flat_bow_share = 0.03, k_fit_bow_share = 0.06;
constexpr double k_surer = 0.5;          // ratio of variances
constexpr double k_failed_variance = 6;  // factor, measured on cylinders

double largest_variance(const RefinedQuad& quad) {
  double largest = 0;
  for (const Eigen::Matrix2d& covariance : quad.corner_covariance)
    largest = std::max(largest, covariance.trace());
  return largest;
}

// Adds to the covariance of a rough fit how far the corners lie from the outline's. Where no better fit was
// found, the sides may not be straight.
void add_doubt(const Quad& outline, bool has_failed, RefinedQuad* refined) {
  for (std::size_t i = 0; i < 4; ++i) {
    const double apart = (refined->corners_px[i] - outline.corners_px[i]).squaredNorm();
    if (has_failed) refined->corner_covariance[i] *= k_failed_variance;
    refined->corner_covariance[i] += apart * Eigen::Matrix2d::Identity();
  }
}

// A pattern is followed from image to image, and no shadow's edge is searched for while the light on both
// sides of a marker's sides stays the same, for k_keep_images. The number doubles, up to k_keep_at_most, each
// time the full reading confirms the result.
constexpr int k_keep_images = 30, k_keep_at_most = 120;
// Largest change: a share of the level, and at least this many grey levels.
constexpr double k_like_level = 0.06, k_like_dark_level = 3;

// Corner i of the marker is corner corner_of(i) of the quadrilateral in which it was read.
template <class Shown>
std::size_t corner_of(const Shown& shown, std::size_t i) {
  return (i + shown.first_corner) % 4;
}

bool is_like_level(double before, double now) {
  return std::abs(now - before) < std::max(k_like_dark_level, k_like_level * before);
}

bool is_like(const UnshadowedSides& known, const Identity& identity, const RefinedQuad& quad) {
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t side = corner_of(identity, i);
    if (!is_like_level(known.outside_level[i], quad.outside_level[side]) ||
        !is_like_level(known.inside_level[i], quad.inside_level[side]))
      return false;
  }
  return true;
}

int kept_longer(int images) { return std::min(2 * images, k_keep_at_most); }

UnshadowedSides unshadowed_sides(const Identity& identity, const RefinedQuad& quad) {
  UnshadowedSides sides;
  for (std::size_t i = 0; i < 4; ++i) {
    sides.outside_level[i] = quad.outside_level[corner_of(identity, i)];
    sides.inside_level[i] = quad.inside_level[corner_of(identity, i)];
  }
  return sides;
}

template <class T>
std::optional<T> aged(std::optional<T> known) {
  if (known) ++known->age;
  return known;
}

// Whether it is the square of a marker that was found before. Another marker may lie inside or around that
// one.
bool is_known(const Quad& quad, const std::vector<Detection>& detections) {
  const auto& q = quad.corners_px;
  const Eigen::Vector2d middle = 0.25 * (q[0] + q[1] + q[2] + q[3]);
  const double side = shortest_side(quad);
  return std::any_of(detections.begin(), detections.end(), [&](const Detection& d) {
    const double longest = longest_side(d);
    return (centre(d) - middle).norm() < 0.15 * longest && side > 0.5 * shortest_side(Quad{d.corners_px}) &&
           side < 1.2 * longest;
  });
}

}  // namespace

// A queue: one thread finds quads while others read them.
class Detector::UnreadQuads {
 public:
  struct Next {
    std::size_t number;
    Quad quad;
  };
  struct End {  // ends the queue however the search ends, so that no thread waits for more
    UnreadQuads& quads;
    ~End() { quads.end(); }
  };
  explicit UnreadQuads(std::vector<Quad>& quads) : quads_(quads), count_(quads.size()) {}

  void add(const Quad& quad) {
    const std::lock_guard lock(mutex_);
    quads_.push_back(quad);
    ++count_;
  }
  void end() { ended_ = true; }

  // Waits for the next quad; nullopt when all are taken and there will be no more.
  std::optional<Next> next_quad() {
    for (;;) {
      bool ended = false;
      WorkerTeam::wait_until([&] { return (ended = ended_) || taken_ < count_; });
      const std::lock_guard lock(mutex_);
      if (taken_ < count_) {
        const std::size_t number = taken_++;
        return Next{number, quads_[number]};
      }
      if (ended) return std::nullopt;
    }
  }

  std::mutex& mutex() { return mutex_; }

 private:
  std::mutex mutex_;
  std::vector<Quad>& quads_;
  std::atomic<std::size_t> count_, taken_ = 0;
  std::atomic<bool> ended_ = false;
};

Detector::Detector(Families families, DetectorOptions options)
    : Detector(families, options, Polarity::dark_on_light) {
  if (!families.with_polarity(true).is_empty())
    of_inverted_.reset(new Detector(families, options, Polarity::light_on_dark));
  all_families_ = std::move(families);
}

Detector::Detector(const Families& families, const DetectorOptions& options, Polarity polarity)
    : families_(families.with_polarity(polarity == Polarity::light_on_dark)),
      thinnest_border_(families_.thinnest_border()),
      options_(options),
      is_inverted_(polarity == Polarity::light_on_dark) {
  options_.threads = std::max(1, options_.threads);
  has_uncovered_codes_ = std::ranges::any_of(families_.codes(), can_have_broken_side);
  options_.broken_markers &= has_uncovered_codes_ || std::ranges::any_of(families_.codes(), can_be_covered);
  workers_.assign(static_cast<std::size_t>(options_.threads),
                  {EdgeRefiner(options_.encoding, is_inverted_), {}});
}

std::vector<Detection> Detector::detect(const cv::Mat& grey, const Lens* lens) {
  std::vector<Detection> detections;
  detect(grey, lens, &detections);
  return detections;
}

void Detector::detect(const cv::Mat& grey, const Lens* lens, std::vector<Detection>* detections) {
  detections->clear();
  detect_more(grey, lens, detections);
}

void Detector::detect_more(const cv::Mat& grey,
                           const Lens* lens,
                           std::vector<Detection>* detections,
                           Reading reading) {
  LIMN_CHECK(grey.empty() || grey.type() == CV_8UC1);
  if (grey.empty()) return;
  if (!families_.is_empty()) {
    const bool broken = options_.broken_markers && reading == Reading::covered;
    WorkerTeam team(options_.threads);
    team.work([&] { find_markers(grey, lens, broken, detections, team); });
  }
  if (!of_inverted_) return;
  cv::bitwise_not(grey, inverted_);
  of_inverted_->detect_more(inverted_, lens, detections, reading);
}

void Detector::find_markers(const cv::Mat& grey,
                            const Lens* lens,
                            bool broken,
                            std::vector<Detection>* detections,
                            WorkerTeam& team) {
  threshold_.apply(grey, {.min_contrast = options_.min_contrast, .above_noise = true}, corner_codes_, team);
  quads_.clear();
  UnreadQuads open(quads_);
  team.parallel_for(team.size(), [&](int worker) {
    if (worker == 0) {
      const UnreadQuads::End end{open};
      finder_.find(corner_codes_, {options_.min_side_px}, [&](const Quad& quad) {
        if (!is_known(quad, *detections)) open.add(quad);
      });
    }
    if (worker == team.size() - 1 && broken) segment_finder_.find(grey, options_.min_contrast, segments_);
    read_quads(grey, lens, Reading::open, open, worker);
  });
  const auto bleed = add_read(std::nullopt, detections);
  if (!broken) return;
  join_segments(grey, *detections, team);
  UnreadQuads covered(quads_);
  covered.end();
  team.parallel_for(team.size(),
                    [&](int worker) { read_quads(grey, lens, Reading::covered, covered, worker); });
  add_read(bleed, detections);
}

// Reads quads until none is left.
void Detector::read_quads(
    const cv::Mat& grey, const Lens* lens, Reading reading, UnreadQuads& unread, int worker) {
  while (const auto next = unread.next_quad())
    if (auto found = read(grey, next->quad, lens, reading, workers_[static_cast<std::size_t>(worker)])) {
      const std::lock_guard lock(unread.mutex());
      found->number = next->number;
      read_.push_back(std::move(*found));
    }
}

// Adds the markers that were read, in the order of their quads, so that threads do not change the result.
// Corrects them by the edge bleed that they show, or else by `known`. Returns the bleed that was used.
std::optional<EdgeBleed> Detector::add_read(const std::optional<EdgeBleed>& known,
                                            std::vector<Detection>* detections) {
  std::sort(read_.begin(), read_.end(), [](const Read& a, const Read& b) { return a.number < b.number; });
  retreats_.clear();
  for (const Read& read : read_)
    if (read.bleed) retreats_.push_back(*read.bleed);
  const std::optional<EdgeBleed> seen = common_edge_bleed(retreats_);
  const std::optional<EdgeBleed>& bleed = seen ? seen : known;
  for (Read& read : read_) {
    Detection& detection = read.detection;
    if (bleed && !detection.by_pattern)
      undo_edge_bleed(*bleed, &detection.corners_px, &detection.corner_covariance);
    add_best_of_square(std::move(detection), detections);
  }
  read_.clear();
  return bleed;
}

void Detector::follow(const cv::Mat& grey,
                      const Lens* lens,
                      std::span<const Detection> last,
                      std::vector<Detection>* detections) {
  LIMN_CHECK(grey.empty() || grey.type() == CV_8UC1);
  detections->clear();
  if (grey.empty()) return;
  if (!of_inverted_) return follow_own(grey, lens, last, detections);
  std::vector<Detection> dark, light;
  for (const Detection& marker : last)
    (of_inverted_->families_.contains(marker.marker.family) ? light : dark).push_back(marker);
  follow_own(grey, lens, dark, detections);
  cv::bitwise_not(grey, inverted_);
  of_inverted_->follow_own(inverted_, lens, light, detections);
}

void Detector::follow_own(const cv::Mat& grey,
                          const Lens* lens,
                          std::span<const Detection> last,
                          std::vector<Detection>* detections) {
  for (const Detection& marker : last)
    if (auto found = found_again(grey, lens, marker)) {
      found->number = read_.size();
      read_.push_back(std::move(*found));
    }
  add_read(std::nullopt, detections);
}

// Finds a marker by the pattern that was fitted in the last image.
std::optional<Detector::Read> Detector::follow_by_pattern(const cv::Mat& grey,
                                                          const Lens* lens,
                                                          const Detection& last) {
  const auto known = aged(last.by_pattern);
  if (!known || known->age >= known->kept_for) return std::nullopt;
  std::array<Eigen::Vector2d, 4> corners_px;
  for (std::size_t i = 0; i < 4; ++i) corners_px[corner_of(*known, i)] = last.corners_px[i];
  const auto found =
      follow_pattern(grey, workers_[0].refiner.light(), corners_px, *known, lens, &workers_[0].fit);
  if (!found) return std::nullopt;
  Read read;
  Detection& detection = read.detection = last;
  for (std::size_t i = 0; i < 4; ++i) {
    detection.corners_px[i] = found->corners_px[corner_of(*known, i)];
    detection.corner_covariance[i] = found->corner_covariance[corner_of(*known, i)];
  }
  detection.by_pattern = found->seen;
  detection.unshadowed = aged(last.unshadowed);
  return read;
}

// Tries to find a marker by its pattern, then from its old corners, then from all quads around there, then
// from segments, for a partly covered one.
std::optional<Detector::Read> Detector::found_again(const cv::Mat& grey,
                                                    const Lens* lens,
                                                    const Detection& last) {
  if (auto followed = follow_by_pattern(grey, lens, last)) return followed;
  const double reach = 0.5 * longest_side(last);
  auto found = read(grey, {last.corners_px, reach}, lens, Reading::open, workers_[0], &last);
  if (found && found->detection.marker == last.marker) return found;
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& corner : last.corners_px) box.extend(corner);
  const double around = reach + k_around_region_px;
  const cv::Rect whole(0, 0, grey.cols, grey.rows);
  const cv::Rect region = whole & cv::Rect(cv::Point(static_cast<int>(std::floor(box.min().x() - around)),
                                                     static_cast<int>(std::floor(box.min().y() - around))),
                                           cv::Point(static_cast<int>(std::ceil(box.max().x() + around)),
                                                     static_cast<int>(std::ceil(box.max().y() + around))));
  if (region.empty()) return std::nullopt;
  const cv::Mat part = grey(region);
  const Eigen::Vector2d origin(region.x, region.y);
  const auto read_quads = [&](Reading reading) -> std::optional<Read> {
    for (Quad& candidate : quads_) {
      for (Eigen::Vector2d& corner : candidate.corners_px) corner += origin;
      found = read(grey, candidate, lens, reading, workers_[0], &last);
      if (found && found->detection.marker == last.marker) return found;
    }
    return std::nullopt;
  };
  WorkerTeam alone(1);
  threshold_.apply(part, {.min_contrast = options_.min_contrast, .above_noise = true}, corner_codes_, alone);
  quads_.clear();
  finder_.find(corner_codes_, {options_.min_side_px},
               [&](const Quad& candidate) { quads_.push_back(candidate); });
  if (auto regular = read_quads(Reading::open)) return regular;
  if (!options_.broken_markers) return std::nullopt;
  segment_finder_.find(part, options_.min_contrast, segments_);
  join_segments(part, {}, alone);
  return read_quads(Reading::covered);
}

// Puts into quads_ the quads that segments form where no marker of `found` lies.
void Detector::join_segments(const cv::Mat& grey, const std::vector<Detection>& found, WorkerTeam& team) {
  constexpr std::size_t k_max_candidates = 400;  // for each of the two kinds of segments
  squares_.clear();
  for (const Detection& detection : found) squares_.emplace_back(detection);
  quads_.clear();
  for (std::vector<Segment>* segments : {&segments_.of_black, &segments_.of_blurred}) {
    std::erase_if(*segments, [&](const Segment& segment) {
      return std::any_of(squares_.begin(), squares_.end(),
                         [&](const ExclusionZone& square) { return square.holds(segment); });
    });
    segment_quad_finder_.find(*segments, grey.cols, grey.rows, k_max_candidates, segment_quads_, team);
    for (const SegmentQuad& candidate : segment_quads_) {
      if (std::any_of(squares_.begin(), squares_.end(),
                      [&](const ExclusionZone& square) { return square.takes(candidate.quad); }))
        continue;
      quads_.push_back(candidate.quad);
      quads_.back().within_px = 5;
    }
  }
}

std::optional<Detector::Read> Detector::read(const cv::Mat& grey,
                                             const Quad& quad,
                                             const Lens* lens,
                                             Reading reading,
                                             Worker& worker,
                                             const Detection* last) const {
  if (!may_be_marker(grey, quad, options_.min_contrast, thinnest_border_)) return std::nullopt;
  const auto as = [&](Reading what) { return read_as(grey, quad, lens, what, worker, last); };
  if (reading != Reading::covered) return as(reading);
  if (may_be_covered_code(grey, quad))
    if (auto found = as(Reading::covered)) return found;
  if (!has_uncovered_codes_ || !may_be_code_with_broken_side(grey, quad, families_)) return std::nullopt;
  return as(Reading::broken_side);
}

std::optional<Detector::Read> Detector::read_as(const cv::Mat& grey,
                                                const Quad& quad,
                                                const Lens* lens,
                                                Reading reading,
                                                Worker& worker,
                                                const Detection* last) const {
  const bool covered = reading != Reading::open;
  const double min_contrast = k_refined_contrast * options_.min_contrast;
  const Sides sides = covered ? Sides::covered : Sides::whole;
  const auto refine = [&](const Quad& start, Effort effort) {
    return worker.refiner.refine(grey, start, min_contrast, lens, effort, sides);
  };
  std::optional<RefinedQuad> rough;
  Quad start = quad;
  if (covered || (!last && shortest_side(quad) > k_rough_above_px)) {
    rough = refine(quad, Effort::rough);
    if (!rough || !identify(grey, *rough, families_, reading, Certainty::any)) return std::nullopt;
    start.corners_px = rough->corners_px;
  }
  auto refined = refine(start, Effort::full);
  auto identity = refined ? identify(grey, *refined, families_, reading) : std::nullopt;
  if (!identity) {  // what lies around a small marker may bend its sides
    if (!rough) rough = refine(quad, Effort::rough);
    identity = rough ? identify(grey, *rough, families_, reading) : std::nullopt;
    if (!identity) return std::nullopt;
    // The cells of bent paper lie nearer to straight sides; its corners are where the bent sides meet.
    const bool is_bent = refined && refined->bow_share > k_flat_bow_share &&
                         !is_blurred(*refined, identity->cells, k_cell_sigmas);
    if (!is_bent) {
      const bool has_failed = !refined;
      refined = rough;
      if (shortest_side(quad) > k_rough_above_px) add_doubt(quad, has_failed, &*refined);
    }
  }
  if (reading == Reading::covered) {  // perhaps nothing is covered, and the paper is bent
    const auto whole = worker.refiner.refine(grey, start, min_contrast, lens, Effort::full, Sides::whole);
    if (whole && whole->bow_share > k_flat_bow_share &&
        largest_variance(*whole) < k_surer * largest_variance(*refined))
      refined = whole;
  }
  const bool is_followed = last && last->marker == identity->marker;
  Read read;
  Detection& detection = read.detection;
  if (is_followed) detection.unshadowed = aged(last->unshadowed);
  auto shadows = ShadowEdges::none;
  const bool is_light_known = detection.unshadowed && is_like(*detection.unshadowed, *identity, *refined);
  if (!is_light_known || detection.unshadowed->age >= detection.unshadowed->kept_for) {
    UnshadowedSides sides = unshadowed_sides(*identity, *refined);
    sides.kept_for = is_light_known ? kept_longer(detection.unshadowed->kept_for) : k_keep_images;
    detection.unshadowed.reset();
    if (!is_inverted_)  // in inverted images shadows are no factors of the light
      shadows = leave_shadow_edges(grey, worker.refiner.light(), identity->cells, lens, &*refined);
    if (shadows == ShadowEdges::none) detection.unshadowed = sides;
  }
  if (shadows != ShadowEdges::left) {
    const auto known = is_followed ? aged(last->by_pattern) : std::nullopt;
    if (!refined->separate || is_blurred(*refined, identity->cells, k_cell_sigmas))
      detection.by_pattern = settle_overlapping_edges(grey, lens, *identity, worker, known, &*refined);
    if (!detection.by_pattern && !covered && refined->bow_share < k_flat_bow_share &&
        !is_blurred(*refined, identity->cells, k_retreat_sigmas) &&
        std::ranges::all_of(refined->corner_visible, std::identity()))
      read.bleed = find_edge_bleed(grey, worker.refiner.light(), refined->corners_px, identity->cells);
  }
  detection.marker = identity->marker;
  detection.score = std::clamp(identity->score, 0.0, 1.0);
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t corner = corner_of(*identity, i);
    detection.corners_px[i] = refined->corners_px[corner];
    detection.corner_covariance[i] = refined->corner_covariance[corner];
    detection.corner_visible[i] = refined->corner_visible[corner];
  }
  return read;
}

// Treats a marker whose edges blur into each other: fits the whole pattern, or else enlarges the corners'
// covariance.
std::optional<PatternAppearance> Detector::settle_overlapping_edges(
    const cv::Mat& grey,
    const Lens* lens,
    const Identity& identity,
    Worker& worker,
    const std::optional<PatternAppearance>& known,
    RefinedQuad* refined) const {
  const auto& light = worker.refiner.light();
  const bool is_kept = known && known->age < known->kept_for;
  if (is_kept) {
    std::array<Eigen::Vector2d, 4> corners_px;
    for (std::size_t i = 0; i < 4; ++i)
      corners_px[corner_of(*known, i)] = refined->corners_px[corner_of(identity, i)];
    if (const auto followed = follow_pattern(grey, light, corners_px, *known, lens, &worker.fit)) {
      for (std::size_t i = 0; i < 4; ++i) {
        const std::size_t corner = corner_of(identity, i);
        refined->corners_px[corner] = followed->corners_px[corner_of(*known, i)];
        refined->corner_covariance[corner] = followed->corner_covariance[corner_of(*known, i)];
      }
      return followed->seen;
    }
  }
  const bool may_fit = options_.pattern_fits && identity.cells.count > 0 &&
                       refined->bow_share < k_fit_bow_share &&
                       shortest_side(Quad{refined->corners_px}) > k_fit_above_px;
  if (may_fit)
    if (auto fitted = fit_pattern(grey, light, *refined, identity.cells, lens, &worker.fit)) {
      refined->corners_px = fitted->corners_px;
      refined->corner_covariance = fitted->corner_covariance;
      fitted->seen.first_corner = identity.first_corner;
      fitted->seen.kept_for = known && !is_kept ? kept_longer(known->kept_for) : k_keep_images;
      return fitted->seen;
    }
  const double doubt_px = k_overlap_doubt * blur_of(*refined);
  for (Eigen::Matrix2d& covariance : refined->corner_covariance)
    covariance += doubt_px * doubt_px * Eigen::Matrix2d::Identity();
  return std::nullopt;
}

}  // namespace limn::tracker
