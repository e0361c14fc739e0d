#include "tracker/body_correspondences.h"

#include <Eigen/Dense>
#include <algorithm>
#include <filesystem>
#include <limits>
#include <string>

#include "tracker/marker_pose.h"

namespace limn::tracker {
namespace {

// Number of markers that may propose a pose, largest first. More only cost time.
constexpr std::size_t k_max_proposers = 6;
// Cost of a marker that cannot be projected at all; as much as for one that is far off.
constexpr double k_lost_marker_cost = 1e7;
// Proposals nearer than this to a minimum (rad) lead to it. It is the noise of a small marker's tilt.
constexpr double k_same_basin = 0.1;
// Refined poses nearer than this (rad) are the same minimum: refinement stops far below it.
constexpr double k_same_minimum = 1e-3;
// Number of proposals that are refined in search of a second minimum.
constexpr int k_max_refined = 3;
// Largest robust cost, for each corner coordinate, of a pose that explains its corners: normalised residuals
// of two.
constexpr double k_explained_cost = 4;

std::array<PointObservation, 4> corners_of(const MarkerCorrespondences& seen, const Detection& detection) {
  std::array<PointObservation, 4> observations;
  const auto corners = square_corners(seen.marker->size_m);
  for (std::size_t i = 0; i < 4; ++i)
    observations[i] = {&seen.camera->lens, seen.camera->imager_from_world,
                       seen.marker->body_from_marker * corners[i], detection.corners_px[i],
                       detection.corner_covariance[i].inverse()};
  return observations;
}

// The corners of the marker's detection that agrees best with a pose, and their cost; nullptr when no
// detection's corners have pixels there.
std::pair<const std::array<PointObservation, 4>*, double> most_consistent(const MarkerCorrespondences& seen,
                                                                          const Pose& world_from_body) {
  const std::array<PointObservation, 4>* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const std::array<PointObservation, 4>& corners : seen.corners) {
    const double value = cost(corners, world_from_body, k_huber);
    if (value < least) {
      least = value;
      best = &corners;
    }
  }
  return {best, least};
}

double cost_of_all(const BodyCorrespondences& correspondences, const Pose& world_from_body) {
  double sum = 0;
  for (const MarkerCorrespondences& seen : correspondences)
    sum += std::min(k_lost_marker_cost, most_consistent(seen, world_from_body).second);
  return sum;
}

double width_px(const MarkerCorrespondences& seen) {
  const auto& c = seen.detections.front()->corners_px;
  return std::max((c[2] - c[0]).norm(), (c[3] - c[1]).norm());
}

struct Proposal {
  Pose world_from_body;
  double cost = 0;
};

// Both branches of every detection of the `most` largest markers, as poses of the body, lowest cost first.
std::vector<Proposal> proposals(const BodyCorrespondences& correspondences, std::size_t most) {
  BodyCorrespondences largest = correspondences;
  std::stable_sort(largest.begin(), largest.end(),
                   [](const MarkerCorrespondences& a, const MarkerCorrespondences& b) {
                     return width_px(a) > width_px(b);
                   });
  largest.resize(std::min(largest.size(), most));
  std::vector<Proposal> found;
  for (const MarkerCorrespondences& seen : largest)
    for (const Detection* detection : seen.detections)
      for (const MarkerPose& pose : marker_poses(seen.camera->lens, seen.marker->size_m,
                                                 detection->corners_px, detection->corner_covariance)) {
        const Pose world_from_body = seen.camera->imager_from_world.inverse() * pose.camera_from_marker *
                                     seen.marker->body_from_marker.inverse();
        found.push_back({world_from_body, cost_of_all(correspondences, world_from_body)});
      }
  std::stable_sort(found.begin(), found.end(),
                   [](const Proposal& a, const Proposal& b) { return a.cost < b.cost; });
  return found;
}

bool is_near(const std::vector<PoseFit>& fits, const Pose& pose, double angle) {
  return std::any_of(fits.begin(), fits.end(), [&](const PoseFit& fit) {
    return angle_between(fit.world_from_body.rotation, pose.rotation) < angle;
  });
}

}  // namespace

BodyCorrespondences correspondences(const Body& body, std::span<const View> views) {
  BodyCorrespondences all;
  for (const View& view : views)
    for (const BodyMarker& marker : body.markers) {
      MarkerCorrespondences seen{&marker, view.camera, {}, {}};
      for (const Detection& detection : view.detections)
        if (is_marker(detection.marker, marker.marker)) {
          seen.detections.push_back(&detection);
          seen.corners.push_back(corners_of(seen, detection));
        }
      if (!seen.detections.empty()) all.push_back(std::move(seen));
    }
  return all;
}

ChosenCorners corners_at(const BodyCorrespondences& correspondences, const Pose& world_from_body) {
  ChosenCorners chosen;
  chosen.observations.reserve(4 * correspondences.size());
  for (const MarkerCorrespondences& seen : correspondences) {
    const std::array<PointObservation, 4>* corners = most_consistent(seen, world_from_body).first;
    if (!corners) continue;
    ++chosen.marker_count;
    chosen.observations.insert(chosen.observations.end(), corners->begin(), corners->end());
  }
  return chosen;
}

std::vector<PoseFit> minima(const BodyCorrespondences& correspondences,
                            std::span<const Pose> predicted,
                            Minima wanted) {
  std::vector<PoseFit> found;
  if (correspondences.empty()) return found;
  const auto refine = [&](const Pose& start, double most_cost) {
    const std::vector<PointObservation> observations = corners_at(correspondences, start).observations;
    const auto fit = fit_pose(observations, start, k_huber);
    if (fit && fit->chi_square < most_cost * 2 * static_cast<double>(observations.size()) &&
        !is_near(found, fit->world_from_body, k_same_minimum))
      found.push_back(*fit);
  };
  for (const Pose& pose : predicted.first(std::min<std::size_t>(2, predicted.size())))
    refine(pose, k_explained_cost);
  const std::size_t proposers = found.empty() ? k_max_proposers : 1;
  // A lone marker's proposals are its two minima already.
  const double basin = correspondences.size() == 1 ? k_same_minimum : k_same_basin;
  int refined = 0;
  if (found.empty() || (found.size() < 2 && wanted == Minima::all))
    for (const Proposal& proposal : proposals(correspondences, proposers)) {
      if (refined == k_max_refined || found.size() == 2) break;
      if (is_near(found, proposal.world_from_body, basin)) continue;
      ++refined;
      refine(proposal.world_from_body, std::numeric_limits<double>::infinity());
    }
  std::stable_sort(found.begin(), found.end(),
                   [](const PoseFit& a, const PoseFit& b) { return a.chi_square < b.chi_square; });
  return found;
}

bool is_marker(const MarkerName& found, const MarkerName& wanted) {
  if (found == wanted) return true;
  const auto is_of_file = [](const MarkerName& name) {
    return name.family.find('/') != std::string::npos || name.id.find('/') != std::string::npos;
  };
  if (!is_of_file(found) && !is_of_file(wanted)) return false;
  const auto bare = [](const MarkerName& name) {
    // aruco:FOLDER/FILE.yml and artoolkit:FOLDER/FILE.patt
    const auto slash = name.family.find_last_of('/');
    const bool has_folder = name.family.rfind("aruco:", 0) == 0 && slash != std::string::npos;
    return MarkerName{has_folder ? "aruco:" + name.family.substr(slash + 1) : name.family,
                      std::filesystem::path(name.id).filename().string()};
  };
  return bare(found) == bare(wanted);
}

}  // namespace limn::tracker
