#include "tracker/body_learn.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "tracker/body_adjust.h"
#include "tracker/marker_pose.h"

namespace limn::tracker {
namespace {

// Relative poses agree when they differ by less than this: the tilt noise of a small marker, far less than
// what separates the branches.
constexpr double k_agree_turn = 0.2;          // rad
constexpr double k_agree_shift_in_sides = 1;  // of the marker
// Pictures of a pair that are compared with each other: the work grows with the square.
constexpr std::size_t k_max_compared = 24;

// Both branches of every marker in one picture, likeliest first.
using PictureOfMarkers = std::map<MarkerName, std::vector<MarkerPose>>;

std::vector<Detection> singles(std::span<const Detection> detections) {
  std::vector<Detection> kept;
  for (const Detection& detection : detections) {
    const auto count = std::count_if(detections.begin(), detections.end(), [&](const Detection& other) {
      return other.marker == detection.marker;
    });
    if (count == 1) kept.push_back(detection);
  }
  return kept;
}

PictureOfMarkers poses_in(const Imager& camera, std::span<const Detection> detections, double size_m) {
  PictureOfMarkers poses;
  for (const Detection& detection : detections) {
    auto both = marker_poses(camera.lens, size_m, detection.corners_px, detection.corner_covariance);
    if (!both.empty()) poses[detection.marker] = std::move(both);
  }
  return poses;
}

struct RelativePose {
  Pose a_from_b;
  double weight = 0;  // of the branches it is made of
};

std::vector<RelativePose> relative_poses(const PictureOfMarkers& picture,
                                         const MarkerName& a,
                                         const MarkerName& b) {
  const auto in_a = picture.find(a), in_b = picture.find(b);
  if (in_a == picture.end() || in_b == picture.end()) return {};
  std::vector<RelativePose> found;
  for (const MarkerPose& pose_a : in_a->second)
    for (const MarkerPose& pose_b : in_b->second)
      found.push_back(
          {pose_a.camera_from_marker.inverse() * pose_b.camera_from_marker, pose_a.weight * pose_b.weight});
  return found;
}

// How well a picture agrees with a relative pose: 1 fully, 0 not at all.
double agreement(const std::vector<RelativePose>& picture, const Pose& a_from_b, double size_m) {
  double best = 0;
  for (const RelativePose& relative : picture) {
    const Vector6d apart = boxminus(relative.a_from_b, a_from_b);
    const double square = apart.head<3>().squaredNorm() / (k_agree_turn * k_agree_turn) +
                          apart.tail<3>().squaredNorm() / std::pow(k_agree_shift_in_sides * size_m, 2);
    best = std::max(best, (0.5 + 0.5 * relative.weight) * std::exp(-square));
  }
  return best;
}

struct Link {
  Pose a_from_b;
  double support = 0;  // pictures that agree
};

// The relative pose of two markers that the pictures agree on best.
std::optional<Link> link(std::span<const PictureOfMarkers> pictures,
                         const MarkerName& a,
                         const MarkerName& b,
                         double size_m) {
  std::vector<std::vector<RelativePose>> seen;
  for (const PictureOfMarkers& picture : pictures) {
    auto relative = relative_poses(picture, a, b);
    if (!relative.empty()) seen.push_back(std::move(relative));
    if (seen.size() == k_max_compared) break;
  }
  std::optional<Link> best;
  for (const auto& picture : seen)
    for (const RelativePose& candidate : picture) {
      double support = 0;
      for (const auto& other : seen) support += agreement(other, candidate.a_from_b, size_m);
      if (!best || support > best->support) best = Link{candidate.a_from_b, support};
    }
  return best;
}

MarkerName most_seen(const std::map<MarkerName, int>& counts) {
  return std::max_element(counts.begin(), counts.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

// From the frame's marker outwards, by the best supported link each time (Prim's spanning tree).
std::map<MarkerName, Pose> chained(std::span<const PictureOfMarkers> pictures,
                                   const std::map<MarkerName, int>& counts,
                                   const MarkerName& frame,
                                   double size_m) {
  std::map<MarkerName, Pose> placed = {{frame, Pose{}}};
  std::map<MarkerName, std::pair<MarkerName, Link>>
      nearest;  // unplaced marker: its best link to a placed one
  MarkerName newest = frame;
  while (true) {
    for (const auto& [name, count] : counts) {
      if (placed.contains(name)) continue;
      const auto found = link(pictures, newest, name, size_m);
      if (!found) continue;
      const auto known = nearest.find(name);
      if (known == nearest.end() || found->support > known->second.second.support)
        nearest[name] = {newest, *found};
    }
    if (nearest.empty()) return placed;
    const auto best = std::max_element(nearest.begin(), nearest.end(), [](const auto& a, const auto& b) {
      return a.second.second.support < b.second.second.support;
    });
    const auto& [from, way] = best->second;
    placed[best->first] = placed.at(from) * way.a_from_b;
    newest = best->first;
    nearest.erase(best);
  }
}

}  // namespace

Result<LearnedBody> learned_body(std::span<const View> views, double size_m) {
  std::vector<std::vector<Detection>> detections;
  std::vector<PictureOfMarkers> pictures;
  std::map<MarkerName, int> counts;
  for (const View& view : views) {
    detections.push_back(singles(view.detections));
    pictures.push_back(poses_in(*view.camera, detections.back(), size_m));
    if (pictures.back().size() < 2) pictures.back().clear();
    for (const auto& [name, poses] : pictures.back()) ++counts[name];
  }
  if (counts.empty())
    return error(
        "expected pictures that show two or more markers of the body together, found none among {}. Look at "
        "light, "
        "focus and --family, and photograph so that neighbours are seen together.",
        views.size());
  LearnedBody learned;
  learned.frame = most_seen(counts);
  const auto placed = chained(pictures, counts, learned.frame, size_m);
  Body start;
  for (const auto& [name, body_from_marker] : placed)
    start.markers.push_back({name, size_m, body_from_marker});
  for (const auto& [name, count] : counts)
    if (!placed.contains(name)) learned.unplaced.push_back(name);

  std::vector<View> usable;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (!pictures[i].empty()) usable.push_back({views[i].camera, detections[i]});
  LIMN_TRY(const Adjustment adjusted, adjusted_body(start, learned.frame, usable));
  learned.pictures = adjusted.pictures;
  learned.rms_px = adjusted.rms_px;
  for (std::size_t i = 0; i < start.markers.size(); ++i)
    learned.markers.push_back({adjusted.body.markers[i], adjusted.covariance[i], adjusted.seen[i]});
  return learned;
}

Body as_body(const LearnedBody& learned, const std::string& name) {
  Body body{name, {}};
  for (const LearnedMarker& marker : learned.markers) body.markers.push_back(marker.marker);
  return body;
}

}  // namespace limn::tracker
