#include "tracker/body_pose.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "tracker/marker_pose.h"
#include "tracker/pose_fit.h"

namespace limn::tracker {
namespace {

// Residuals beyond this many standard deviations count linearly: a corner under a finger.
constexpr double k_huber = 3;
// Markers that may propose a pose, largest first: the rest add nothing but time.
constexpr std::size_t k_max_proposers = 6;

// One marker of the body and the detections in one view that carry its name.
struct Seen {
  const BodyMarker* marker;
  const Imager* camera;
  std::vector<const Detection*> detections;
};

using CornerSights = std::array<PointSight, 4>;

CornerSights sights_of(const Seen& seen, const Detection& detection) {
  CornerSights sights;
  const auto corners = square_corners(seen.marker->size_m);
  for (std::size_t i = 0; i < 4; ++i)
    sights[i] = {&seen.camera->lens, seen.camera->imager_from_world,
                 seen.marker->body_from_marker * corners[i], detection.corners_px[i],
                 detection.corner_covariance[i].inverse()};
  return sights;
}

// The detection of this marker that agrees best with a pose, and its cost.
std::pair<const Detection*, double> most_consistent(const Seen& seen, const Pose& world_from_body) {
  const Detection* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Detection* detection : seen.detections) {
    const double value = cost(sights_of(seen, *detection), world_from_body, k_huber);
    if (value < least) {
      least = value;
      best = detection;
    }
  }
  return {best, least};
}

// A marker that cannot be placed at all costs as much as one that is far off.
constexpr double k_lost_marker_cost = 1e7;

double cost_of_all(std::span<const Seen> all, const Pose& world_from_body) {
  double sum = 0;
  for (const Seen& seen : all)
    sum += std::min(k_lost_marker_cost, most_consistent(seen, world_from_body).second);
  return sum;
}

std::vector<Seen> seen_markers(const Body& body, std::span<const View> views) {
  std::vector<Seen> all;
  for (const View& view : views)
    for (const BodyMarker& marker : body.markers) {
      Seen seen{&marker, view.camera, {}};
      for (const Detection& detection : view.detections)
        if (is_marker(detection.marker, marker.marker)) seen.detections.push_back(&detection);
      if (!seen.detections.empty()) all.push_back(std::move(seen));
    }
  return all;
}

double width_px(const Seen& seen) {
  const auto& c = seen.detections.front()->corners_px;
  return std::max((c[2] - c[0]).norm(), (c[3] - c[1]).norm());
}

// Both branches of every detection of the largest markers, as poses of the body.
std::vector<Pose> proposals(std::vector<Seen> all) {
  std::sort(all.begin(), all.end(), [](const Seen& a, const Seen& b) { return width_px(a) > width_px(b); });
  all.resize(std::min(all.size(), k_max_proposers));
  std::vector<Pose> poses;
  for (const Seen& seen : all)
    for (const Detection* detection : seen.detections)
      for (const MarkerPose& pose : marker_poses(seen.camera->lens, seen.marker->size_m,
                                                 detection->corners_px, detection->corner_covariance))
        poses.push_back(seen.camera->imager_from_world.inverse() * pose.camera_from_marker *
                        seen.marker->body_from_marker.inverse());
  return poses;
}

std::vector<PointSight> chosen_sights(std::span<const Seen> all, const Pose& world_from_body, int* markers) {
  std::vector<PointSight> sights;
  *markers = 0;
  for (const Seen& seen : all) {
    const Detection* detection = most_consistent(seen, world_from_body).first;
    if (!detection) continue;
    ++*markers;
    for (const PointSight& sight : sights_of(seen, *detection)) sights.push_back(sight);
  }
  return sights;
}

}  // namespace

bool is_marker(const MarkerName& found, const MarkerName& wanted) {
  const auto bare = [](const MarkerName& name) {
    // aruco:FOLDER/FILE.yml and artoolkit:FOLDER/FILE.patt
    const auto slash = name.family.find_last_of('/');
    const bool has_folder = name.family.rfind("aruco:", 0) == 0 && slash != std::string::npos;
    return MarkerName{has_folder ? "aruco:" + name.family.substr(slash + 1) : name.family,
                      std::filesystem::path(name.id).filename().string()};
  };
  return bare(found) == bare(wanted);
}

std::optional<Track> world_from_body(const Body& body, std::span<const View> views, Stamp captured_at) {
  const std::vector<Seen> all = seen_markers(body, views);
  if (all.empty()) return std::nullopt;
  std::optional<Pose> start;
  double least = std::numeric_limits<double>::infinity();
  for (const Pose& pose : proposals(all)) {
    const double value = cost_of_all(all, pose);
    if (!(value < least)) continue;
    least = value;
    start = pose;
  }
  if (!start) return std::nullopt;
  Track track;
  const std::vector<PointSight> sights = chosen_sights(all, *start, &track.marker_count);
  const auto fit = fit_pose(sights, *start, k_huber);
  if (!fit) return std::nullopt;
  track.body = body.name;
  track.world_from_body = fit->world_from_body;
  track.covariance = fit->covariance;
  track.rms_px = fit->rms_px;
  track.captured_at = captured_at;
  return track;
}

}  // namespace limn::tracker
