#include "calib/judge/capture_faults.h"

#include <Eigen/Dense>
#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <optional>
#include <tuple>

#include "core/log.h"
#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr int k_least_samples = 200;  // in a series; medians over fewer samples are too uncertain
// Share of the image; the smallest board that can be found fills 2 %.
constexpr double k_least_lit = 0.002;
constexpr double k_same_px = 1;       // two projectors' labels at one camera pixel never agree by chance
constexpr double k_same_share = 0.3;  // share of the pixels that both projectors illuminate
// Range of coarse pairs' sums; a camera that is not linear shows 0.017.
constexpr double k_level_range = 0.03;
// The same for flicker that is taken out, in root mean squares of one image's: the range of 20 sums of two.
constexpr double k_flicker_range = 4;
// Displacement of a stripe's edge, camera pixels, for a flicker of 1: half of the gains' difference over the
// slope of an edge with a blur of 0.8 pixels.
constexpr double k_edge_px = 0.7;
constexpr int k_wide_stripe_px = 16;       // stripes of this width keep all of their contrast under blur
constexpr double k_white_contrast = 0.15;  // deviation from 1; indirect light adds 0.04 to white
// Amount below 1; sharp captures show 1.36 over stripes of 4 pixels.
constexpr double k_white_under_narrow = 0.05;
// Share of samples that are off; above it an image is missing, light is no cause.
constexpr double k_lost_pair = 0.5;
// Difference of the shares that are off under the finest stripes and under wide ones.
constexpr double k_between = 0.06;
constexpr double k_between_level = 0.01;  // decrease of the light there: interpolation before a gamma above 1
// Image shift between the first images of a series and the last, as a share of the width: sound captures show
// up to 0.00005 (noise). The second limit, in camera pixels, is for small images.
constexpr double k_shift_share = 0.000125, k_shift_px = 0.1;
// Share of full contrast that is left on stripes of 2 pixels: a blur of 1.2 pixels (standard deviation)
// leaves 0.15; with less, edges are found from coarser bits alone.
constexpr double k_sharp = 0.15;
constexpr double k_in_focus = 0.5;                // the same of sound captures
constexpr double k_least_stripe_contrast = 0.01;  // noise hides less
constexpr double k_seen_stripe_px = 1.4;  // in camera pixels; narrower stripes blur in the sharpest camera
constexpr double k_pedestal = 16;         // maximum number of levels that sensors add to black
constexpr double k_room_share = 0.6;      // the room's share of white's light
constexpr double k_rough_aspect = 0.05;   // deviation of fy / fx from 1, from homographies alone
constexpr size_t k_least_corners = 8;     // minimum for a homography that noise does not distort
constexpr double k_saturated_share = 0.2;
// Deviation of the waves' mean light from one half: as for a gamma that is 12 % off. Beyond it the phase of 3
// steps errs by 0.1 pixel in waves of 16; 6 steps tolerate more.
constexpr double k_wave_level = 0.025;

// All series of one camera and one projector.
struct PairSeries {
  const Observed& observed;
  int camera = 0, projector = 0;
  std::vector<const CaptureQuality*> series;  // with enough illuminated samples
  std::vector<double> lit;                    // for every series, share of the image
  std::vector<Matrix2d> maps;                 // for each pose: d projector pixel / d camera pixel

  const std::string& camera_name() const {
    return observed.observations.cameras[static_cast<size_t>(camera)].name;
  }
  const std::string& projector_name() const {
    return observed.observations.projectors[static_cast<size_t>(projector)].name;
  }
  const std::string& pose_name(const CaptureQuality& quality) const {
    return observed.observations.poses[static_cast<size_t>(quality.pose)];
  }
  std::string both() const { return camera_name() + " of " + projector_name(); }
  template <typename F>
  double median_of(F&& value) const {
    std::vector<double> values;
    for (const CaptureQuality* quality : series) values.push_back(value(*quality));
    return median(std::move(values));
  }
};

// The affine map that fits a pose's matches; nullopt when there are too few or they lie on a line.
std::optional<Matrix2d> affine(const std::vector<const Match*>& matches) {
  if (matches.size() < 6) return std::nullopt;
  Vector2d from = Vector2d::Zero(), to = Vector2d::Zero();
  for (const Match* match : matches) {
    from += match->px_camera;
    to += match->px_projector;
  }
  from /= static_cast<double>(matches.size());
  to /= static_cast<double>(matches.size());
  Matrix2d normal = Matrix2d::Zero(), product = Matrix2d::Zero();
  for (const Match* match : matches) {
    normal += (match->px_camera - from) * (match->px_camera - from).transpose();
    product += (match->px_projector - to) * (match->px_camera - from).transpose();
  }
  if (!(std::abs(normal.determinant()) > 1e-3 * normal.squaredNorm())) return std::nullopt;
  return product * normal.inverse();
}

std::vector<PairSeries> series_of_pairs(const Observed& observed) {
  const Observations& observations = observed.observations;
  std::vector<PairSeries> pairs;
  for (int camera = 0; camera < static_cast<int>(observations.cameras.size()); ++camera) {
    for (int projector = 0; projector < static_cast<int>(observations.projectors.size()); ++projector) {
      PairSeries seen{observed, camera, projector, {}, {}, {}};
      const CapturedDevice& device = observations.cameras[static_cast<size_t>(camera)];
      for (const CaptureQuality& quality : observed.quality) {
        if (quality.camera == camera && quality.projector == projector && quality.samples >= k_least_samples)
          seen.series.push_back(&quality);
      }
      for (const DecodeShare& share : observed.decoded) {
        if (share.camera == camera && share.projector == projector)
          seen.lit.push_back(static_cast<double>(share.lit) / device.width / device.height);
      }
      std::map<int, std::vector<const Match*>> by_pose;
      for (const Match& match : observations.matches) {
        if (match.camera == camera && match.projector == projector) by_pose[match.pose].push_back(&match);
      }
      for (const auto& [pose, matches] : by_pose) {
        if (const auto map = affine(matches)) seen.maps.push_back(*map);
      }
      pairs.push_back(std::move(seen));
    }
  }
  return pairs;
}

void note_dark(const Observed& observed, const std::vector<PairSeries>& pairs, std::vector<Fault>* faults) {
  for (size_t projector = 0; projector < observed.observations.projectors.size(); ++projector) {
    double best = 0;
    size_t poses = 0, with_labels = 0;
    for (const PairSeries& seen : pairs) {
      if (seen.projector != static_cast<int>(projector)) continue;
      best = std::max(best, median(seen.lit));
      poses = std::max(poses, seen.lit.size());
      with_labels = std::max(with_labels, seen.maps.size());
    }
    if (poses == 0 || best >= k_least_lit || 2 * with_labels > poses) continue;
    faults->push_back(
        {FaultName::wrong_display,
         fmt::format(
             "the patterns of {} illuminate {:.2f} % of the image, though the board is seen in {} poses",
             observed.observations.projectors[projector].name, 100 * best, poses),
         "check that it is switched on, its lens cap is off and its patterns are shown on its own display; "
         "darken the room",
         Severity::reject});
  }
}

// Number of pixels that both projectors illuminate, and how many of these have the same label.
struct Agreement {
  int places = 0, same = 0;
};

Agreement agreement(const Observations& observations, int a, int b) {
  std::map<std::tuple<int, int, long, long>, Vector2d> labels;
  const auto place = [](const Match& match) {
    return std::tuple(match.camera, match.pose, std::lround(match.px_camera.x() / 2),
                      std::lround(match.px_camera.y() / 2));
  };
  for (const Match& match : observations.matches) {
    if (match.projector == a) labels[place(match)] = match.px_projector;
  }
  Agreement found;
  for (const Match& match : observations.matches) {
    if (match.projector != b) continue;
    const auto other = labels.find(place(match));
    if (other == labels.end()) continue;
    ++found.places;
    found.same += (other->second - match.px_projector).norm() < k_same_px ? 1 : 0;
  }
  return found;
}

void note_same_light(const Observations& observations, std::vector<Fault>* faults) {
  const int projectors = static_cast<int>(observations.projectors.size());
  for (int a = 0; a < projectors; ++a) {
    for (int b = a + 1; b < projectors; ++b) {
      const Agreement found = agreement(observations, a, b);
      if (found.places < k_least_samples / 10 || found.same < k_same_share * found.places) continue;
      faults->push_back(
          {FaultName::wrong_display,
           fmt::format(
               "the patterns of {} illuminate what those of {} do: {} of {} pixels have the same label",
               observations.projectors[static_cast<size_t>(b)].name,
               observations.projectors[static_cast<size_t>(a)].name, found.same, found.places),
           "give each projector its own display; the displays must not mirror (clone) each other",
           Severity::reject});
    }
  }
}

void note_mirrored(const PairSeries& seen, std::vector<Fault>* faults) {
  const auto against = std::count_if(seen.maps.begin(), seen.maps.end(),
                                     [](const Matrix2d& map) { return map.determinant() < 0; });
  if (2 * static_cast<size_t>(against) <= seen.maps.size()) return;
  faults->push_back(
      {FaultName::mirrored_projection,
       fmt::format("the pixels of {} are mirrored against those of {} in {} of {} poses",
                   seen.projector_name(), seen.camera_name(), against, seen.maps.size()),
       "switch off rear projection (mirroring) in the projector's menu or the display's settings; likewise "
       "a camera's mirror mode",
       Severity::reject});
}

// Index of an axis's finest pair in a series' groups. Pairs come first: columns, rows, each from the widest
// stripes to the finest; phase leaves out the same number of finest bits for both.
struct Pairs {
  size_t columns = 0, count = 0;
  int lowest = 0;  // finest bit that has a pair
  size_t finest(int axis) const { return (axis == 0 ? columns : count) - 1; }
  size_t per_axis(int axis) const { return axis == 0 ? columns : count - columns; }
};

Pairs pairs_of(const PairSeries& seen, const CaptureQuality& quality) {
  const CapturedDevice& device = seen.observed.observations.projectors[static_cast<size_t>(seen.projector)];
  const int columns = static_cast<int>(std::bit_width(static_cast<unsigned>(device.width - 1)));
  const int rows = static_cast<int>(std::bit_width(static_cast<unsigned>(device.height - 1)));
  int count = -1;  // without white and black
  for (const GroupQuality& group : quality.groups) count += group.count == 2 ? 1 : 0;
  const int lowest = std::max(0, (columns + rows - count) / 2);
  if (count <= 0) return {1, 1, lowest};  // shown without inverses
  return {static_cast<size_t>(std::max(1, columns - lowest)), static_cast<size_t>(std::max(1, count)),
          lowest};
}

// How many more samples are off under the finest stripes than under stripes four times as wide, and how much
// darker they are; on the worse axis.
struct Between {
  double off = 0, darker = 0;
};

Between between(const PairSeries& seen, const CaptureQuality& quality) {
  const Pairs pairs = pairs_of(seen, quality);
  Between worst;
  for (const int axis : {0, 1}) {
    if (pairs.per_axis(axis) < 4 || pairs.lowest > 0) continue;
    const GroupQuality &fine = quality.groups[pairs.finest(axis)],
                       &wide = quality.groups[pairs.finest(axis) - 2];
    const Between here{fine.off - wide.off, wide.level - fine.level};
    if (here.off > worst.off) worst = here;
  }
  return worst;
}

void note_between(const PairSeries& seen, std::vector<Fault>* faults) {
  const double off = seen.median_of([&](const CaptureQuality& h) { return between(seen, h).off; });
  const double darker = seen.median_of([&](const CaptureQuality& h) { return between(seen, h).darker; });
  if (off < k_between || darker < k_between_level) return;
  faults->push_back(
      {FaultName::keystone_or_scaling,
       fmt::format(
           "{}: under the finest stripes, {:.0f} % more pixels than under wide stripes differ from the "
           "sum of white and black (median {:.1f} % of it): the image is interpolated between the "
           "computer and the panel",
           seen.both(), 100 * off, 100 * darker),
       "send the projector its native resolution; switch off keystone, zoom, overscan and sharpening in the "
       "projector and the display's settings"});
}

// Range of the sums of pairs with wide stripes, which blur does not affect, and of white and black.
double level_range(const PairSeries& seen, const CaptureQuality& quality) {
  const Pairs pairs = pairs_of(seen, quality);
  double low = 1, high = 1;
  const auto collect = [&](const GroupQuality& group) {
    if (group.off > k_lost_pair) return;
    low = std::min(low, group.level);
    high = std::max(high, group.level);
  };
  for (const int axis : {0, 1}) {
    const size_t first = pairs.finest(axis) + 1 - pairs.per_axis(axis);
    for (size_t i = 0; i < (pairs.per_axis(axis) + 1) / 2; ++i) collect(quality.groups[first + i]);
  }
  collect(quality.groups.back());
  return high - low;
}

// Contrast of white against black divided by that of the widest stripes: 1 when nothing reacts to how much of
// the image is bright. Over narrow stripes, which blur, it is larger.
double white_contrast(const PairSeries& seen, const CaptureQuality& quality) {
  const Pairs pairs = pairs_of(seen, quality);
  double widest = 1e-9;
  for (const int axis : {0, 1}) {
    const size_t first = pairs.finest(axis) + 1 - pairs.per_axis(axis);
    for (size_t i = 0; i < std::min<size_t>(3, pairs.per_axis(axis)); ++i)
      widest = std::max(widest, quality.groups[first + i].contrast);
  }
  return quality.groups.back().contrast / widest;
}

// The flicker that decoding has taken out of a series; 0: none.
double flicker_of(const CaptureQuality& quality) {
  return quality.shake.flickers ? quality.shake.gain_rms : 0;
}

// Flicker of single images is not drift.
bool note_exposure(const PairSeries& seen, std::vector<Fault>* faults) {
  const double limit = std::max(k_level_range, k_flicker_range * seen.median_of(flicker_of));
  const double range = seen.median_of([&](const CaptureQuality& h) { return level_range(seen, h); });
  const double white = seen.median_of([&](const CaptureQuality& h) { return white_contrast(seen, h); });
  const bool narrow = seen.series[0]->widest_stripe_px < k_wide_stripe_px;
  const bool white_fits = narrow ? white > 1 - k_white_under_narrow : std::abs(white - 1) < k_white_contrast;
  if (range < limit && white_fits) return false;
  faults->push_back(
      {FaultName::exposure_drift,
       fmt::format("{}: the sum of an image and its inverse changes by {:.1f} % within a series; the "
                   "contrast of white against black is {:.2f} of that of {} stripes",
                   seen.both(), 100 * range, white, narrow ? "narrow" : "wide"),
       "switch off automatic exposure, gain and white balance; let camera and projector warm up; keep the "
       "room's light steady"});
  return true;
}

// The poses whose series have a value above 0, and the median of these values.
struct PosesWith {
  std::vector<std::string> poses;
  std::vector<double> values;
};
template <typename F>
PosesWith poses_with(const PairSeries& seen, F&& value) {
  PosesWith found;
  for (const CaptureQuality* quality : seen.series) {
    const double one = value(*quality);
    if (!(one > 0)) continue;
    found.poses.push_back(seen.pose_name(*quality));
    found.values.push_back(one);
  }
  return found;
}

void note_shake(const PairSeries& seen, std::vector<Fault>* faults) {
  const auto vibrates = [](const CaptureQuality& quality) {
    return quality.shake.shakes && !quality.shake.drifts;
  };
  const PosesWith shaken =
      poses_with(seen, [&](const CaptureQuality& h) { return vibrates(h) ? h.shake.shift_rms_px : 0; });
  if (shaken.poses.empty()) return;
  const double share =
      seen.median_of([&](const CaptureQuality& h) { return vibrates(h) ? h.shake.share : 1; });
  faults->push_back(
      {FaultName::shake,
       fmt::format("{}: the images of a series are displaced by {:.2f} px (root mean square) against each "
                   "other, {}; it was measured and taken out",
                   seen.both(), median(shaken.values),
                   share > 0.5 ? "stripes and board alike: the camera vibrates" : "the board vibrates"),
       "put the tripods and the board on firm ground, keep people and machines still during a series",
       Severity::note, shaken.poses, 1, median(shaken.values)});
}

void note_flicker(const PairSeries& seen, std::vector<Fault>* faults) {
  const PosesWith flickering = poses_with(seen, flicker_of);
  if (flickering.poses.empty()) return;
  faults->push_back(
      {FaultName::flicker,
       fmt::format("{}: the light of single images differs by {:.1f} % (root mean square); it was measured "
                   "and taken out",
                   seen.both(), 100 * median(flickering.values)),
       "expose for whole periods of the lamp and of the mains (multiples of 1/50 or 1/60 s), with a fixed "
       "exposure",
       Severity::note, flickering.poses, 1, k_edge_px * median(flickering.values)});
}

void note_motion(const PairSeries& seen, std::vector<Fault>* faults) {
  const CapturedDevice& camera = seen.observed.observations.cameras[static_cast<size_t>(seen.camera)];
  const double limit = std::max(k_shift_px, k_shift_share * camera.width);
  for (const CaptureQuality* quality : seen.series) {
    if (quality->shift_patches < 4 || quality->shift_px < limit) continue;
    if (quality->shake.shakes && !quality->shake.drifts) continue;  // shake is taken out
    faults->push_back(
        {FaultName::moved_during_capture,
         fmt::format("{}, {}: the image moved by {:.2f} px (parts of it by {:.2f} px) between the first "
                     "images and the last; {:.2f} px may be noise",
                     seen.pose_name(*quality), seen.both(), quality->shift_px, quality->shift_worst_px,
                     limit),
         "put board, camera and projector on firm ground and capture this pose again, or leave it out with "
         "--skip-poses " +
             seen.pose_name(*quality),
         Severity::doubt,
         {seen.pose_name(*quality)}});
  }
}

// Remaining contrast of stripes that the camera can resolve, on the worse axis, and their width in projector
// pixels.
struct Sharpness {
  double contrast = 1;
  int stripe_px = 2;
};

Sharpness sharpness(const PairSeries& seen, const CaptureQuality& quality) {
  const Pairs pairs = pairs_of(seen, quality);
  std::vector<double> scales;  // camera pixels per projector pixel
  for (const Matrix2d& map : seen.maps) scales.push_back(1 / std::sqrt(std::abs(map.determinant())));
  const double scale = scales.empty() ? 1 : median(scales);
  size_t back = 0;
  Sharpness found{1, 2 << pairs.lowest};
  while (found.stripe_px * scale < k_seen_stripe_px && back + 2 < pairs.per_axis(1)) {
    ++back;
    found.stripe_px *= 2;
  }
  const bool wide = quality.widest_stripe_px >= k_wide_stripe_px;
  double full = wide ? 0 : quality.groups.back().contrast;
  for (size_t i = 0; i < pairs.count; ++i) full = std::max(full, quality.groups[i].contrast);
  for (const int axis : {0, 1})
    found.contrast = std::min(found.contrast, quality.groups[pairs.finest(axis) - back].contrast / full);
  return found;
}

void note_defocus(const PairSeries& seen, std::vector<Fault>* faults) {
  const double contrast =
      seen.median_of([&](const CaptureQuality& h) { return sharpness(seen, h).contrast; });
  if (contrast >= k_sharp) return;
  // Stripes of a Gaussian blur keep the contrast exp(-(pi blur / width)^2 / 2); the scatter of an edge is
  // proportional to the blur. In focus it is that of k_in_focus.
  const double blurs =
      std::sqrt(std::log(std::max(contrast, k_least_stripe_contrast)) / std::log(k_in_focus));
  faults->push_back(
      {FaultName::defocus,
       fmt::format(
           "{}: stripes of {} projector pixels keep {:.0f} % of their contrast; in focus they keep over "
           "{:.0f} %",
           seen.both(), sharpness(seen, *seen.series[0]).stripe_px, 100 * contrast, 100 * k_sharp),
       "focus the projector at the prototype's distance, then the camera; close the camera's aperture a "
       "little",
       Severity::doubt,
       {},
       blurs});
}

// The exponent p for which light 0.5 + 0.5 cos (mean 1/2), raised to p, has this mean: the mean is
// G(p + 1/2) / (sqrt(pi) G(p + 1)), which decreases with p.
double power_of_waves(double mean) {
  double low = 0.05, high = 20;
  for (int i = 0; i < 40; ++i) {
    const double p = std::sqrt(low * high);
    const double found = std::exp(std::lgamma(p + 0.5) - std::lgamma(p + 1)) * std::numbers::inv_sqrtpi;
    (found > mean ? low : high) = p;
  }
  return std::sqrt(low * high);
}

void note_gamma(const PairSeries& seen, std::vector<Fault>* faults) {
  const double level = seen.median_of([](const CaptureQuality& h) { return h.wave_level; });
  if (std::abs(level - 0.5) < k_wave_level) return;
  const double power = power_of_waves(level);
  faults->push_back(
      {FaultName::projector_gamma,
       fmt::format(
           "{}: the waves' mean light is {:.1f} % of white's; sinusoids have 50 %. It looks as if their "
           "light was raised to the power {:.2f}",
           seen.both(), 100 * level, power),
       fmt::format(
           "let limn solve measure the projector's response and draw the waves with it (code_options' "
           "response), or multiply their gamma by {:.2f}; set the projector to a fixed picture mode "
           "and the camera to linear images",
           power)});
}

bool note_room_light(const PairSeries& seen, std::vector<Fault>* faults) {
  const double share = seen.median_of([](const CaptureQuality& h) {
    return std::max(0.0, h.black_level - k_pedestal) / std::max(k_pedestal, h.white_level - k_pedestal);
  });
  if (share < k_room_share) return false;
  faults->push_back(
      {FaultName::ambient_light,
       fmt::format("{}: {:.0f} levels under black, {:.0f} under white (medians): room light is {:.0f} % of "
                   "the light",
                   seen.both(), seen.median_of([](const CaptureQuality& h) { return h.black_level; }),
                   seen.median_of([](const CaptureQuality& h) { return h.white_level; }), 100 * share),
       "darken the room, or use a brighter projector picture mode; then raise the exposure until white is "
       "just below saturation"});
  return true;
}

bool note_saturation(const PairSeries& seen, std::vector<Fault>* faults) {
  const double share = seen.median_of([](const CaptureQuality& h) { return h.saturated; });
  if (share < k_saturated_share) return false;
  faults->push_back(
      {FaultName::saturated,
       fmt::format("{}: white saturates {:.0f} % of the illuminated pixels", seen.both(), 100 * share),
       "shorten the exposure or close the aperture until white is just below saturation"});
  return true;
}

void note_odd_images(const PairSeries& seen, std::vector<Fault>* faults) {
  for (const CaptureQuality* quality : seen.series) {
    if (quality->odd.empty()) continue;
    const OddImage& odd = quality->odd.front();
    faults->push_back(
        {FaultName::repeated_pictures,
         fmt::format("{}, {}: {} {}{}", seen.pose_name(*quality), seen.both(), odd.file.filename().string(),
                     odd.finding,
                     quality->odd.size() > 1 ? fmt::format(" (and {} more)", quality->odd.size() - 1) : ""),
         "increase the delay between showing and grabbing (the display's latency), and capture this pose "
         "again",
         Severity::doubt,
         {seen.pose_name(*quality)}});
  }
}

// fy / fx of a camera from its images of the flat board alone, with its axis assumed in the middle.
std::optional<double> camera_aspect(const Observations& observations, int camera) {
  std::map<int, std::pair<std::vector<cv::Point3f>, std::vector<cv::Point2f>>> by_pose;
  for (const CornerObservation& corner : observations.corners) {
    if (corner.camera != camera) continue;
    const Eigen::Vector3f p = observations.board.p_corner(corner.corner).cast<float>();
    auto& [points, px] = by_pose[corner.pose];
    points.emplace_back(p.x(), p.y(), 0.F);
    px.emplace_back(static_cast<float>(corner.px.x()), static_cast<float>(corner.px.y()));
  }
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<std::vector<cv::Point2f>> px;
  for (const auto& [pose, seen] : by_pose) {
    if (seen.first.size() < k_least_corners) continue;
    points.push_back(seen.first);
    px.push_back(seen.second);
  }
  if (points.size() < 3) return std::nullopt;
  const CapturedDevice& device = observations.cameras[static_cast<size_t>(camera)];
  const cv::Mat k = cv::initCameraMatrix2D(points, px, {device.width, device.height}, 0);
  const double aspect = k.at<double>(1, 1) / k.at<double>(0, 0);
  if (!std::isfinite(aspect)) return std::nullopt;
  return aspect;
}

void note_camera_shapes(const Observations& observations, std::vector<Fault>* faults) {
  for (int camera = 0; camera < static_cast<int>(observations.cameras.size()); ++camera) {
    const auto aspect = camera_aspect(observations, camera);
    if (!aspect || std::abs(*aspect - 1) < k_rough_aspect) continue;
    faults->push_back(
        {FaultName::wrong_camera_resolution,
         fmt::format("{}: its pixels are about {:.2f} times as wide as high",
                     observations.cameras[static_cast<size_t>(camera)].name, *aspect),
         "use a resolution with the sensor's own shape, without stretching, digital zoom or cropping"});
  }
}

}  // namespace

std::vector<Fault> unsolved_faults(const Observed& observed) {
  std::vector<Fault> faults = capture_faults(observed);
  note_camera_shapes(observed.observations, &faults);
  return faults;
}

std::vector<Fault> capture_faults(const Observed& observed) {
  std::vector<Fault> faults;
  const std::vector<PairSeries> pairs = series_of_pairs(observed);
  note_dark(observed, pairs, &faults);
  note_same_light(observed.observations, &faults);
  for (const PairSeries& seen : pairs) {
    note_mirrored(seen, &faults);
    if (seen.series.empty()) continue;
    note_between(seen, &faults);
    const bool unsteady = note_exposure(seen, &faults);
    note_motion(seen, &faults);
    note_shake(seen, &faults);
    if (!unsteady) note_flicker(seen, &faults);
    note_defocus(seen, &faults);
    const bool bright = !unsteady && note_room_light(seen, &faults);
    const bool clipped = note_saturation(seen, &faults);
    // Light that changes, and white that is clipped, make correct waves look wrong.
    if (!unsteady && !clipped) note_gamma(seen, &faults);
    // Unsteady light and noise make sums wrong, too.
    if (!unsteady && !bright) note_odd_images(seen, &faults);
  }
  return faults;
}

}  // namespace limn::calib
