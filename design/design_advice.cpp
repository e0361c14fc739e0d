#include "design/design_advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "calib/judge/assess.h"
#include "design/sight_lines.h"
#include "design/volume_points.h"

namespace limn::apps {
namespace {

using Eigen::Vector3d;

// What is asked of a rig; past these there is advice. Error: calib's `good`.
constexpr double k_least_angle_deg = 15, k_most_angle_deg = 60, k_least_coverage = 0.9, k_most_pixel_mm = 1.5;
constexpr double k_most_steep_deg = 60;   // there a pixel is twice as long as wide
constexpr double k_least_marker_px = 32;  // below, poses flip (measured: 6 % at 24 px, none at 48)
constexpr double k_least_contrast = 5;    // projected white over the room's light: black looks black enough

void advise_on_error(const PredictedAccuracy& predicted_accuracy,
                     const DescribedRig& described,
                     std::vector<std::string>* advice) {
  for (std::size_t i = 0; i < predicted_accuracy.error_mm.size(); ++i) {
    if (predicted_accuracy.error_mm[i] <= calib::k_good_mm) continue;
    const std::string& name = described.rig.projectors[i].name;
    advice->push_back(
        predicted_accuracy.measuring_mm[i] > predicted_accuracy.calibration_mm[i]
            ? fmt::format("{}: {:.2f} mm, most of it from measuring where the prototype stands: give {} more "
                          "pixels on it (narrower lens, nearer).",
                          name, predicted_accuracy.error_mm[i], described.rig.cameras.front().name)
            : fmt::format(
                  "{}: {:.2f} mm, most of it from the calibration: more board poses, a larger board, a "
                  "wider angle to {}.",
                  name, predicted_accuracy.error_mm[i], described.rig.cameras.front().name));
  }
}

void advise_on_pairs(const PredictedAccuracy& predicted_accuracy,
                     const DescribedRig& described,
                     std::vector<std::string>* advice) {
  for (const PredictedPair& pair : predicted_accuracy.pairs) {
    if (pair.camera != described.rig.cameras.front().name) continue;
    if (pair.angle_deg < k_least_angle_deg)
      advice->push_back(
          fmt::format("{} and {} look from almost the same place ({:.0f} degrees): move them apart "
                      "to {:g} degrees or more, depth is read from that angle.",
                      pair.camera, pair.projector, pair.angle_deg, k_least_angle_deg));
    if (pair.angle_deg > k_most_angle_deg)
      advice->push_back(
          fmt::format("{} and {} stand {:.0f} degrees apart: below {:g} degrees both see the board, "
                      "and the prototype, well.",
                      pair.camera, pair.projector, pair.angle_deg, k_most_angle_deg));
  }
}

void advise_on_imagers(const PredictedAccuracy& predicted_accuracy,
                       const DescribedRig& described,
                       std::vector<std::string>* advice) {
  for (const auto* imagers : {&predicted_accuracy.cameras, &predicted_accuracy.projectors}) {
    for (const PredictedImager& imager : *imagers)
      if (imager.steep_deg > k_most_steep_deg)
        advice->push_back(
            fmt::format("{}: too steep, {:.0f} degrees from the lit side's normal: below {:g}; more to the "
                        "front, or another "
                        "one that faces this side.",
                        imager.name, imager.steep_deg, k_most_steep_deg));
  }
  for (const PredictedImager& projector : predicted_accuracy.projectors) {
    if (projector.pixel_mm > k_most_pixel_mm)
      advice->push_back(fmt::format(
          "{}: too far, a pixel is {:.1f} mm on the surface (at most {:g}): nearer, a longer throw, "
          "or more pixels.",
          projector.name, projector.pixel_mm, k_most_pixel_mm));
    if (described.room_lux > 0 && projector.lux > 0 && projector.lux < k_least_contrast * described.room_lux)
      advice->push_back(fmt::format(
          "{}: too dim, {:.0f} lux on the lit side beside {:.0f} lux of the room (at least {:g} times): "
          "darken the room to {:.0f} lux, nearer, or more lumens.",
          projector.name, projector.lux, described.room_lux, k_least_contrast,
          projector.lux / k_least_contrast));
  }
}

void advise_on_markers(const PredictedAccuracy& predicted_accuracy,
                       const DescribedRig& described,
                       std::vector<std::string>* advice) {
  for (const PredictedMarker& marker : predicted_accuracy.markers) {
    if (marker.farthest_px >= k_least_marker_px) continue;
    const double needed_mm = 1000 * described.marker_m * k_least_marker_px / marker.farthest_px;
    advice->push_back(fmt::format(
        "{}: too small, a marker of {:g} mm is {:.0f} pixels at the volume's far end (at least {:g}, "
        "below its tilt flips): markers of {:.0f} mm, a narrower lens, or more pixels.",
        marker.camera, 1000 * described.marker_m, marker.farthest_px, k_least_marker_px,
        std::ceil(needed_mm)));
  }
}

void advise_on_coverage(const PredictedAccuracy& predicted_accuracy,
                        const DescribedRig& described,
                        const std::vector<Vector3d>& points,
                        std::vector<std::string>* advice) {
  if (predicted_accuracy.coverage >= k_least_coverage) return;
  const Imager& camera = described.rig.cameras.front();
  const double seen = share_reached(points, [&](const Vector3d& p) { return reaches(camera, p); });
  if (seen < k_least_coverage)
    advice->push_back(fmt::format("{} sees {:.0f} % of the volume: a wider lens, or farther away.",
                                  camera.name, 100 * seen));
  const double lit = share_reached(points, [&](const Vector3d& p) {
    return std::any_of(described.rig.projectors.begin(), described.rig.projectors.end(),
                       [&](const Imager& projector) { return reaches(projector, p); });
  });
  if (lit < k_least_coverage)
    advice->push_back(
        fmt::format("the projectors reach {:.0f} % of the volume: farther away, a shorter throw, or "
                    "one more.",
                    100 * lit));
}

}  // namespace

std::vector<std::string> design_advice(const PredictedAccuracy& predicted_accuracy,
                                       const DescribedRig& described) {
  std::vector<std::string> advice;
  advise_on_error(predicted_accuracy, described, &advice);
  advise_on_coverage(predicted_accuracy, described, volume_points(described), &advice);
  advise_on_pairs(predicted_accuracy, described, &advice);
  advise_on_imagers(predicted_accuracy, described, &advice);
  advise_on_markers(predicted_accuracy, described, &advice);
  return advice;
}

}  // namespace limn::apps
