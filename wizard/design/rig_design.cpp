#include "wizard/design/rig_design.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include "calib/judge/assess.h"
#include "calib/judge/uncertainty.h"
#include "calib/solve.h"
#include "tracker/pose_fit.h"
#include "wizard/design/design_advice.h"
#include "wizard/design/sight_lines.h"
#include "wizard/design/simulated_observations.h"
#include "wizard/design/volume_points.h"

namespace limn::design {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_two_sided_95 = 1.96;  // standard deviations
// A marker's corners, in halves of its side.
const std::array<Vector2d, 4> k_corners = {Vector2d(-1, -1), {1, -1}, {1, 1}, {-1, 1}};

// The cosine between an imager's ray to a point and the lit side's normal; 0 if it is behind that side.
double facing(const DescribedRig& described, const Imager& imager, const Vector3d& p_world) {
  return std::max(0.0, described.d_front.dot((optical_centre(imager) - p_world).normalized()));
}

PredictedImager imager_foreseen(const DescribedRig& described,
                                const Imager& imager,
                                double lumens,
                                const std::vector<Vector3d>& points) {
  PredictedImager out{.name = imager.name};
  const Vector3d p_imager = imager.imager_from_world * described.p_centre;
  const double cosine = facing(described, imager, described.p_centre);
  out.distance_m = p_imager.norm();
  out.pixel_mm = 1000 * p_imager.z() / imager.lens.fx();
  out.surface_mm = cosine > 0 ? out.pixel_mm / cosine : std::numeric_limits<double>::infinity();
  out.steep_deg = std::acos(cosine) / k_degree;
  out.coverage = share_reached(points, [&](const Vector3d& p) { return reaches(imager, p); });
  const double image_m2 = 1e-6 * out.pixel_mm * out.pixel_mm * imager.width * imager.height;
  out.lux = lumens / image_m2 * cosine;
  return out;
}

std::vector<PredictedPair> pairs_of(const DescribedRig& described, const std::vector<Vector3d>& points) {
  std::vector<PredictedPair> pairs;
  for (const Imager& camera : described.rig.cameras) {
    for (const Imager& projector : described.rig.projectors) {
      const Vector3d to_camera = (optical_centre(camera) - described.p_centre).normalized();
      const Vector3d to_projector = (optical_centre(projector) - described.p_centre).normalized();
      pairs.push_back({camera.name, projector.name,
                       std::acos(std::clamp(to_camera.dot(to_projector), -1.0, 1.0)) / k_degree,
                       share_reached(points, [&](const Vector3d& p) {
                         return reaches(camera, p) && reaches(projector, p);
                       })});
    }
  }
  return pairs;
}

// The corners of a marker in the image; nullopt if the camera cannot project one.
std::optional<std::array<Vector2d, 4>> corners_of(const DescribedRig& described,
                                                  const Imager& camera,
                                                  const Pose& world_from_marker) {
  const double half = described.marker_m / 2;
  std::array<Vector2d, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto px =
        camera.project(world_from_marker * Vector3d(k_corners[i].x() * half, k_corners[i].y() * half, 0));
    if (!px) return std::nullopt;
    corners[i] = *px;
  }
  return corners;
}

Pose marker_at(const DescribedRig& described, const Vector3d& p_world) {
  const Pose facing = upright_looking_at(p_world + described.d_front, p_world);
  return Pose(facing.inverse().rotation, p_world);
}

// The marker's shortest side in the image.
double side_px(const std::array<Vector2d, 4>& corners) {
  double shortest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 4; ++i)
    shortest = std::min(shortest, (corners[(i + 1) % 4] - corners[i]).norm());
  return shortest;
}

// The errors follow from the covariance that the tracker states for a marker's pose. nullopt: the camera does
// not see the marker.
std::optional<PredictedMarker> marker_of(const DescribedRig& described,
                                         const Imager& camera,
                                         const std::vector<Vector3d>& points) {
  const Pose world_from_marker = marker_at(described, described.p_centre);
  const auto corners = corners_of(described, camera, world_from_marker);
  if (!corners || !reaches(camera, described.p_centre) || facing(described, camera, described.p_centre) <= 0)
    return std::nullopt;
  const double half = described.marker_m / 2;
  std::vector<tracker::PointObservation> observations;
  for (std::size_t i = 0; i < 4; ++i)
    observations.push_back({&camera.lens, camera.imager_from_world,
                            Vector3d(k_corners[i].x() * half, k_corners[i].y() * half, 0), (*corners)[i],
                            Eigen::Matrix2d::Identity() / (described.marker_px * described.marker_px)});
  const auto fit = tracker::fit_pose(observations, world_from_marker);
  if (!fit) return std::nullopt;
  const Eigen::Matrix3d camera_from_world =
      upright_looking_at(optical_centre(camera), described.p_centre).rotation_matrix();
  const Eigen::Matrix3d place =
      camera_from_world * fit->covariance.bottomRightCorner<3, 3>() * camera_from_world.transpose();
  const std::vector<Eigen::Matrix2d> across = {place.topLeftCorner<2, 2>()};
  const Vector3d p_farthest =
      *std::max_element(points.begin(), points.end(), [&](const Vector3d& a, const Vector3d& b) {
        return (a - optical_centre(camera)).squaredNorm() < (b - optical_centre(camera)).squaredNorm();
      });
  const auto farthest = corners_of(described, camera, marker_at(described, p_farthest));
  return PredictedMarker{.camera = camera.name,
                         .side_px = side_px(*corners),
                         .farthest_px = farthest ? side_px(*farthest) : 0,
                         .across_mm = 1000 * calib::p95_of({&across, 1}),
                         .along_mm = 1000 * k_two_sided_95 * std::sqrt(place(2, 2))};
}

}  // namespace

Result<PredictedAccuracy> predict_accuracy(const DescribedRig& described) {
  const std::vector<Vector3d> points = volume_points(described);
  PredictedAccuracy predicted_accuracy;
  predicted_accuracy.pairs = pairs_of(described, points);
  predicted_accuracy.coverage = share_reached(points, [&](const Vector3d& p) {
    return reaches(described.rig.cameras.front(), p) &&
           std::any_of(described.rig.projectors.begin(), described.rig.projectors.end(),
                       [&](const Imager& projector) { return reaches(projector, p); });
  });
  for (const Imager& camera : described.rig.cameras) {
    predicted_accuracy.cameras.push_back(imager_foreseen(described, camera, 0, points));
    if (const auto marker = marker_of(described, camera, points))
      predicted_accuracy.markers.push_back(*marker);
  }
  for (std::size_t i = 0; i < described.rig.projectors.size(); ++i)
    predicted_accuracy.projectors.push_back(
        imager_foreseen(described, described.rig.projectors[i], described.lumens[i], points));
  calib::Observed observed;
  observed.observations = simulated_observations(described);
  LIMN_TRY(const calib::Solution solution, calib::solve(observed.observations));
  LIMN_TRY(const calib::Assessment assessment, calib::assess(observed, {}, solution));
  predicted_accuracy.error_mm = assessment.predicted_error_mm;
  calib::Uncertainty believed =
      calib::estimated_uncertainty(observed.observations, solution, {}, assessment.held_out);
  const double measured_px = believed.measured_px;
  believed.measured_px = 0;
  predicted_accuracy.calibration_mm = calib::propagated_error_mm(observed.observations, solution, believed);
  believed.covariance.setZero();
  believed.measured_px = measured_px;
  predicted_accuracy.measuring_mm = calib::propagated_error_mm(observed.observations, solution, believed);
  predicted_accuracy.advice = design_advice(predicted_accuracy, described);
  return predicted_accuracy;
}

}  // namespace limn::design
