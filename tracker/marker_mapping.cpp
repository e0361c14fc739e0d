#include "tracker/marker_mapping.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "tracker/marker_map_adjustment.h"
#include "tracker/marker_pose.h"

namespace limn::tracker {
namespace {

// Relative poses agree when they differ by less than this: the tilt noise of a small marker, which is far
// less than the difference between the branches.
constexpr double k_agree_turn = 0.2;          // rad
constexpr double k_agree_shift_in_sides = 1;  // in sides of the marker
// Largest number of images that are compared for a pair; the work grows with its square.
constexpr std::size_t k_max_compared = 24;

// Both branches of every marker in one image, likeliest first.
using ImageOfMarkers = std::map<MarkerName, std::vector<MarkerPose>>;

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

ImageOfMarkers poses_in(const Imager& camera, std::span<const Detection> detections, double size_m) {
  ImageOfMarkers poses;
  for (const Detection& detection : detections) {
    auto both = marker_poses(camera.lens, size_m, detection.corners_px, detection.corner_covariance);
    if (!both.empty()) poses[detection.marker] = std::move(both);
  }
  return poses;
}

struct RelativePose {
  Pose a_from_b;
  double weight = 0;  // product of the weights of its two branches
};

std::vector<RelativePose> relative_poses(const ImageOfMarkers& image,
                                         const MarkerName& a,
                                         const MarkerName& b) {
  const auto in_a = image.find(a), in_b = image.find(b);
  if (in_a == image.end() || in_b == image.end()) return {};
  std::vector<RelativePose> found;
  for (const MarkerPose& pose_a : in_a->second)
    for (const MarkerPose& pose_b : in_b->second)
      found.push_back(
          {pose_a.camera_from_marker.inverse() * pose_b.camera_from_marker, pose_a.weight * pose_b.weight});
  return found;
}

// How well an image agrees with a relative pose, from 1 (fully) to 0 (not at all).
double agreement(const std::vector<RelativePose>& image, const Pose& a_from_b, double size_m) {
  double best = 0;
  for (const RelativePose& relative : image) {
    const Vector6d apart = boxminus(relative.a_from_b, a_from_b);
    const double square = apart.head<3>().squaredNorm() / (k_agree_turn * k_agree_turn) +
                          apart.tail<3>().squaredNorm() / std::pow(k_agree_shift_in_sides * size_m, 2);
    best = std::max(best, (0.5 + 0.5 * relative.weight) * std::exp(-square));
  }
  return best;
}

struct Link {
  Pose a_from_b;
  double support = 0;  // sum of the images' agreement
};

// The relative pose of two markers that most images agree on.
std::optional<Link> link(std::span<const ImageOfMarkers> images,
                         const MarkerName& a,
                         const MarkerName& b,
                         double size_m) {
  std::vector<std::vector<RelativePose>> seen;
  for (const ImageOfMarkers& image : images) {
    auto relative = relative_poses(image, a, b);
    if (!relative.empty()) seen.push_back(std::move(relative));
    if (seen.size() == k_max_compared) break;
  }
  std::optional<Link> best;
  for (const auto& image : seen)
    for (const RelativePose& candidate : image) {
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

// Places markers outwards from the frame's marker, by the best supported link each time (Prim's spanning
// tree).
std::map<MarkerName, Pose> chained(std::span<const ImageOfMarkers> images,
                                   const std::map<MarkerName, int>& counts,
                                   const MarkerName& frame,
                                   double size_m) {
  std::map<MarkerName, Pose> placed = {{frame, Pose{}}};
  std::map<MarkerName, std::pair<MarkerName, Link>>
      nearest;  // for each unplaced marker, its best link to a placed one
  MarkerName newest = frame;
  while (true) {
    for (const auto& [name, count] : counts) {
      if (placed.contains(name)) continue;
      const auto found = link(images, newest, name, size_m);
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

Result<MarkerMap> map_markers(std::span<const View> views, double size_m) {
  std::vector<std::vector<Detection>> detections;
  std::vector<ImageOfMarkers> images;
  std::map<MarkerName, int> counts;
  for (const View& view : views) {
    detections.push_back(singles(view.detections));
    images.push_back(poses_in(*view.camera, detections.back(), size_m));
    if (images.back().size() < 2) images.back().clear();
    for (const auto& [name, poses] : images.back()) ++counts[name];
  }
  if (counts.empty())
    return error(
        "expected images that show two or more markers of the body together, found none among {}. Check the "
        "light, the focus and --family, and photograph neighbouring markers together.",
        views.size());
  MarkerMap learned;
  learned.frame = most_seen(counts);
  const auto placed = chained(images, counts, learned.frame, size_m);
  Body start;
  for (const auto& [name, body_from_marker] : placed)
    start.markers.push_back({name, size_m, body_from_marker});
  for (const auto& [name, count] : counts)
    if (!placed.contains(name)) learned.unplaced.push_back(name);

  std::vector<View> usable;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (!images[i].empty()) usable.push_back({views[i].camera, detections[i]});
  LIMN_TRY(const Adjustment adjusted, adjusted_marker_map(start, learned.frame, usable));
  learned.images = adjusted.images;
  learned.rms_px = adjusted.rms_px;
  for (std::size_t i = 0; i < start.markers.size(); ++i)
    learned.markers.push_back({adjusted.body.markers[i], adjusted.covariance[i], adjusted.seen[i]});
  return learned;
}

Body as_body(const MarkerMap& learned, const std::string& name) {
  Body body{name, {}};
  for (const MappedMarker& marker : learned.markers) body.markers.push_back(marker.marker);
  return body;
}

}  // namespace limn::tracker
