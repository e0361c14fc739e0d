#include "session/section_rest.h"

#include <algorithm>
#include <numbers>

#include "scene/scene.h"

namespace limn::session {
namespace {

constexpr double k_rest_s = 0.4;
constexpr double k_least_s = 0.15;  // a marker that was seen for less has not been held up
constexpr double k_rests_m = 0.010, k_rests_rad = 8 * std::numbers::pi / 180;

}  // namespace

void SectionRest::note(std::span<const Track> tracks) {
  const auto track = std::ranges::find(tracks, scene::section_body(), &Track::body);
  if (track == tracks.end() || track->tracking != TrackingState::measured) return;
  if (!seen_.empty() && seen_.back().captured_at == track->captured_at) return;
  seen_.push_back(*track);
  while (seconds_between(seen_.front().captured_at, seen_.back().captured_at) > k_rest_s) seen_.pop_front();
}

bool SectionRest::has_rested() const {
  if (seen_.empty() || seconds_between(seen_.front().captured_at, seen_.back().captured_at) < k_least_s)
    return false;
  const Pose& last = seen_.back().world_from_body;
  return std::ranges::all_of(seen_, [&](const Track& track) {
    return (track.world_from_body.translation - last.translation).norm() <= k_rests_m &&
           angle_between(track.world_from_body.rotation, last.rotation) <= k_rests_rad;
  });
}

}  // namespace limn::session
