#pragma once

#include <optional>
#include <span>

#include "core/frame.h"
#include "core/imager.h"
#include "core/marker.h"
#include "core/track.h"
#include "tracker/detection.h"

namespace limn::tracker {

/// What one camera saw at a moment.
struct View {
  const Imager* camera = nullptr;
  std::span<const Detection> detections;
};

/// The pose of a body from its markers in one or several cameras' pictures of one moment. Every marker seen
/// proposes both of its branches; the one that suits all markers best starts a joint Gauss-Newton over all
/// corners, weighted by their covariance, with a Huber loss. A marker found twice in a picture counts once:
/// the one that agrees with the body. nullopt when none of the body's markers gives a pose.
std::optional<Track> world_from_body(const Body& body, std::span<const View> views, Stamp captured_at);

/// Whether a detection is this marker. Names of files compare without their folders.
bool is_marker(const MarkerName& found, const MarkerName& wanted);

}  // namespace limn::tracker
