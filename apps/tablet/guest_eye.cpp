#include "apps/tablet/guest_eye.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "tracker/sighting.h"

namespace limn::apps {
namespace {

constexpr double k_fov_deg = 65;        // of most tablets and phones, horizontally
constexpr double k_guess_share = 0.25;  // of the focal length, one standard deviation: 50 to 90 degrees
constexpr int k_full_scan_every = 3;    // as of a room's camera (WatchOptions)
constexpr double k_gate_px = 3,
                 k_gate_of_median = 4;  // corners further off belong to a marker that was moved
constexpr double k_sure =
    9;  // by so much (chi square) must a lone marker's pose be likelier than its mirror's

// All markers whose place is known, as one body in the world.
Body room_of(std::span<const Body> bodies, std::span<const Track> tracks) {
  Body room{"room", {}};
  for (const Body& body : bodies)
    for (const Track& track : tracks) {
      if (track.body != body.name || track.sight == Sight::lost) continue;
      for (const BodyMarker& marker : body.markers)
        room.markers.push_back(
            {marker.marker, marker.size_m, track.world_from_body * marker.body_from_marker});
    }
  return room;
}

// How far off each marker's corners are, RMS px.
std::vector<double> misfits(const tracker::Sighting& seen, const Pose& pose) {
  std::vector<double> out;
  for (const tracker::SeenMarker& marker : seen) {
    const tracker::Sighting alone = {marker};
    double squares = 0;
    const auto chosen = tracker::corners_at(alone, pose);
    for (const tracker::PointSight& sight : chosen.sights) {
      Eigen::Vector2d r;
      squares += tracker::residual(sight, pose, &r) ? r.squaredNorm() : 1e12;
    }
    out.push_back(std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, chosen.sights.size()))));
  }
  return out;
}

// Without the markers that stand elsewhere than was said.
tracker::Sighting without_moved(const tracker::Sighting& seen, const Pose& pose) {
  const std::vector<double> off = misfits(seen, pose);
  std::vector<double> sorted = off;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double gate = std::max(k_gate_px, k_gate_of_median * *middle);
  tracker::Sighting kept;
  for (std::size_t i = 0; i < seen.size(); ++i)
    if (off[i] <= gate) kept.push_back(seen[i]);
  return kept;
}

}  // namespace

GuestEye::GuestEye(tracker::Families families)
    : detector_(std::move(families), {.encoding = tracker::Encoding::srgb}) {}

GuestSight GuestEye::look(const cv::Mat& bgr, std::span<const Body> bodies, std::span<const Track> tracks) {
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  Imager camera = viewer_imager(Pose(), grey.cols, grey.rows, k_fov_deg);
  detector_.follow(grey, nullptr, detections_, &followed_);
  const bool search = pictures_++ % k_full_scan_every == 0 || followed_.size() < detections_.size();
  std::swap(detections_, followed_);
  if (search) detector_.detect_more(grey, nullptr, &detections_);

  GuestSight out;
  out.focal_stddev_px = k_guess_share * camera.lens.fx();
  const auto nothing = [&](const char* why) {
    last_.reset();
    out.why = why;
    return out;
  };
  if (detections_.empty()) return nothing("No markers in view: point the camera at the prototype.");
  const Body room = room_of(bodies, tracks);
  const tracker::View view{&camera, detections_};
  const tracker::Sighting seen = tracker::sighting(room, std::span(&view, 1));
  if (seen.empty())
    return nothing("The markers in view are not known in the room: its own cameras must see them, too.");
  const auto fitted = [](const tracker::Sighting& markers, const Pose& start) {
    return tracker::fit_pose(tracker::corners_at(markers, start).sights, start, tracker::k_huber);
  };
  std::vector<tracker::PoseFit> fits = tracker::minima(seen);
  if (fits.empty()) return nothing("The markers in view are too small or too steep: go nearer.");
  tracker::PoseFit fit = fits.front();
  const tracker::Sighting kept = without_moved(seen, fit.world_from_body);
  if (!kept.empty() && kept.size() < seen.size())
    if (const auto again = fitted(kept, fit.world_from_body)) fit = *again;
  if (kept.size() < 2 && fits.size() > 1 && fits[1].chi_square - fits[0].chi_square < k_sure)
    return nothing("One marker alone, from straight ahead: bring a second one into view.");
  last_ = fit.world_from_body;
  out.markers = static_cast<int>(kept.size());
  out.rms_px = fit.rms_px;
  camera.imager_from_world = fit.world_from_body;
  out.view = camera;
  return out;
}

}  // namespace limn::apps
