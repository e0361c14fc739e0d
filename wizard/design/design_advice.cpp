#include "wizard/design/design_advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "calib/judge/assess.h"
#include "wizard/design/sight_lines.h"
#include "wizard/design/volume_points.h"

namespace limn::design {
namespace {

using Eigen::Vector3d;

// Limits; beyond them there is advice. The limit of the error is calib's limit of a good rig.
constexpr double k_least_angle_deg = 15, k_most_angle_deg = 60, k_least_coverage = 0.9, k_most_pixel_mm = 1.5;
constexpr double k_most_steep_deg = 60;  // at this angle a pixel on the surface is twice as long as wide
// With fewer pixels a marker's tilt is ambiguous (measured: 6 % flipped at 24 px, none at 48).
constexpr double k_least_marker_px = 32;
// Projected white divided by the room's light; above it, black is dark enough.
constexpr double k_least_contrast = 5;

void advise_on_error(const PredictedAccuracy& predicted_accuracy,
                     const DescribedRig& described,
                     std::vector<std::string>* advice) {
  for (std::size_t i = 0; i < predicted_accuracy.error_mm.size(); ++i) {
    if (predicted_accuracy.error_mm[i] <= calib::k_good_mm) continue;
    const std::string& name = described.rig.projectors[i].name;
    advice->push_back(
        predicted_accuracy.measuring_mm[i] > predicted_accuracy.calibration_mm[i]
            ? fmt::format("{}: error {:.2f} mm, mostly from measuring the prototype's pose: give {} more "
                          "pixels on the prototype (a narrower lens, or nearer).",
                          name, predicted_accuracy.error_mm[i], described.rig.cameras.front().name)
            : fmt::format("{}: error {:.2f} mm, mostly from the calibration: use more board poses, a larger "
                          "board, or a wider angle to {}.",
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
          fmt::format("{} and {} see the volume from almost the same direction ({:.0f} degrees apart): move "
                      "them to {:g} degrees or more, because depth is measured by that angle.",
                      pair.camera, pair.projector, pair.angle_deg, k_least_angle_deg));
    if (pair.angle_deg > k_most_angle_deg)
      advice->push_back(
          fmt::format("{} and {} are {:.0f} degrees apart: move them to less than {:g} degrees, so that both "
                      "see the board and the prototype well.",
                      pair.camera, pair.projector, pair.angle_deg, k_most_angle_deg));
  }
}

void advise_on_imagers(const PredictedAccuracy& predicted_accuracy,
                       const DescribedRig& described,
                       std::vector<std::string>* advice) {
  for (const auto* imagers : {&predicted_accuracy.cameras, &predicted_accuracy.projectors}) {
    for (const PredictedImager& imager : *imagers)
      if (imager.steep_deg > k_most_steep_deg)
        advice->push_back(fmt::format(
            "{}: too steep, {:.0f} degrees from the normal of the lit side (at most {:g}): move it to "
            "the front, or add another one that faces this side.",
            imager.name, imager.steep_deg, k_most_steep_deg));
  }
  for (const PredictedImager& projector : predicted_accuracy.projectors) {
    if (projector.pixel_mm > k_most_pixel_mm)
      advice->push_back(fmt::format(
          "{}: too far, a pixel is {:.1f} mm on the surface (at most {:g}): move it nearer, or use a longer "
          "throw or more pixels.",
          projector.name, projector.pixel_mm, k_most_pixel_mm));
    if (described.room_lux > 0 && projector.lux > 0 && projector.lux < k_least_contrast * described.room_lux)
      advice->push_back(fmt::format(
          "{}: too dim, {:.0f} lux on the lit side against {:.0f} lux of the room (at least {:g} times as "
          "much is needed): darken the room to {:.0f} lux, move it nearer, or use more lumens.",
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
        "{}: too small, a marker of {:g} mm is {:.0f} pixels wide at the volume's far end (at least {:g}; "
        "with fewer its tilt is ambiguous): use markers of {:.0f} mm, a narrower lens, or more pixels.",
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
    advice->push_back(
        fmt::format("{} sees {:.0f} % of the volume: use a wider lens, or move it farther away.", camera.name,
                    100 * seen));
  const double lit = share_reached(points, [&](const Vector3d& p) {
    return std::any_of(described.rig.projectors.begin(), described.rig.projectors.end(),
                       [&](const Imager& projector) { return reaches(projector, p); });
  });
  if (lit < k_least_coverage)
    advice->push_back(fmt::format(
        "the projectors reach {:.0f} % of the volume: move them farther away, use a shorter throw, or add "
        "another one.",
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

}  // namespace limn::design
