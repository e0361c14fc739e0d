#include "tracker/swapped_cameras.h"

#include <algorithm>
#include <limits>

#include "tracker/body_correspondences.h"
#include "tracker/body_pose.h"

namespace limn::tracker {
namespace {

constexpr double k_compare_cameras_every_s = 2;

// RMS residual of a body that several cameras see: at most k_right_px with correct camera names, at least
// k_wrong_px with exchanged ones.
constexpr double k_right_px = 3, k_wrong_px = 12;

// The largest RMS residual of the bodies that several cameras see; 0 when there are none.
double misfit_px(std::span<const Body> bodies,
                 std::span<const Imager* const> cameras,
                 std::span<const std::vector<Detection>> detections,
                 Stamp captured_at) {
  std::vector<View> views;
  for (std::size_t i = 0; i < cameras.size(); ++i) views.push_back({cameras[i], detections[i]});
  double worst = 0;
  for (const Body& body : bodies) {
    int seen_by = 0;
    for (const View& view : views) seen_by += !correspondences(body, {&view, 1}).empty();
    if (seen_by < 2) continue;
    const auto track = world_from_body(body, views, captured_at);
    worst = std::max(worst, track ? track->rms_px : std::numeric_limits<double>::infinity());
  }
  return worst;
}

}  // namespace

std::optional<std::pair<std::string, std::string>> swapped_cameras(
    const Rig& rig,
    std::span<const Body> bodies,
    std::span<const std::vector<Detection>> detections,
    Stamp captured_at) {
  LIMN_CHECK(detections.size() == rig.cameras.size());
  std::vector<const Imager*> cameras;
  for (const Imager& camera : rig.cameras) cameras.push_back(&camera);
  const double as_named = misfit_px(bodies, cameras, detections, captured_at);
  if (as_named < k_wrong_px) return std::nullopt;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    for (std::size_t k = i + 1; k < cameras.size(); ++k) {
      if (cameras[i]->width != cameras[k]->width || cameras[i]->height != cameras[k]->height) continue;
      std::swap(cameras[i], cameras[k]);
      const double exchanged = misfit_px(bodies, cameras, detections, captured_at);
      std::swap(cameras[i], cameras[k]);
      if (exchanged < k_right_px) return std::pair(cameras[i]->name, cameras[k]->name);
    }
  }
  return std::nullopt;
}

std::optional<std::string> SwappedCamerasCheck::check(const Rig& rig,
                                                      std::span<const Body> bodies,
                                                      std::span<const std::vector<Detection>> detections,
                                                      Stamp captured_at) {
  if (has_warned_ || rig.cameras.size() < 2 ||
      seconds_between(compared_at_, captured_at) < k_compare_cameras_every_s)
    return std::nullopt;
  compared_at_ = captured_at;
  const auto swapped = swapped_cameras(rig, bodies, detections, captured_at);
  if (!swapped) return std::nullopt;
  has_warned_ = true;
  return fmt::format(
      "{} and {} seem to be exchanged: each sees what the other should see. Exchange their cables, "
      "or their addresses in the devices file.",
      swapped->first, swapped->second);
}

void SwappedCamerasCheck::begin_anew(Stamp at) {
  has_warned_ = false;
  compared_at_ = at;
}

}  // namespace limn::tracker
