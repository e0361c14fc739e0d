#include "limn/bodies.h"

#include <fmt/format.h>

#include <cmath>
#include <set>

#include "library/body_conversion.h"
#include "library/convert.h"
#include "library/marker_conversion.h"
#include "scene/marker_file.h"
#include "tracker/body_estimate.h"
#include "tracker/body_filter.h"
#include "tracker/family.h"
#include "tracker/predict.h"

namespace limn::LIMN_VERSIONED {
namespace {

// The moment `seconds` after the clock's zero.
limn::Stamp stamp_of(double seconds) {
  constexpr double k_most_s = 9e9;  // what nanoseconds in 64 bits hold
  if (!(std::abs(seconds) < k_most_s))
    throw Error(fmt::format("time: expected seconds between -{0} and {0}, found {1}.", k_most_s, seconds));
  return limn::shifted(limn::Stamp{}, seconds);
}

Track to_public(const limn::Track& track) {
  return {.body = track.body,
          .world_from_body = LIMN_VERSIONED::to_public(track.world_from_body),
          .covariance = LIMN_VERSIONED::to_public(track.covariance),
          .marker_count = track.marker_count,
          .rms_px = track.rms_px,
          .captured_at_s = limn::seconds_of(track.captured_at),
          .at_s = limn::seconds_of(track.at),
          .tracking = static_cast<Tracking>(track.tracking)};
}
static_assert(static_cast<int>(Tracking::lost) == static_cast<int>(limn::TrackingState::lost) &&
              static_cast<int>(Tracking::extrapolated) ==
                  static_cast<int>(limn::TrackingState::extrapolated));

std::vector<Track> to_public(const std::vector<limn::Track>& tracks) {
  std::vector<Track> list;
  for (const limn::Track& track : tracks) list.push_back(to_public(track));
  return list;
}

// The views with detections of their own.
struct RoomViews {
  std::vector<std::vector<limn::tracker::Detection>> detections;
  std::vector<limn::tracker::View> views;
};

RoomViews to_room(std::span<const View> views) {
  RoomViews room;
  for (const View& view : views) {
    if (!view.camera) throw Error("view: expected a camera, found none. Set View::camera.");
    room.detections.emplace_back();
    for (const Marker& marker : view.markers) room.detections.back().push_back(detection_of(marker));
  }
  for (std::size_t i = 0; i < views.size(); ++i)
    room.views.push_back({&LIMN_VERSIONED::to_room(*views[i].camera), room.detections[i]});
  return room;
}

void check(const std::vector<limn::Body>& bodies) {
  std::set<std::string> names;
  for (const limn::Body& body : bodies) {
    if (!names.insert(body.name).second)
      throw Error(fmt::format("bodies: expected names of their own, found '{}' twice.", body.name));
    if (body.markers.empty()) throw Error(fmt::format("body '{}': expected markers, found none.", body.name));
    for (const limn::BodyMarker& marker : body.markers)
      if (!(marker.size_m > 0 && marker.size_m <= 1e-3 * limn::k_largest_marker_mm))
        throw Error(fmt::format("body '{}', marker {}: expected a side in metres (> 0), found {}.", body.name,
                                marker.marker.text(), marker.size_m));
  }
}

limn::tracker::MotionModel to_room(const Motion& motion) {
  return {.jerk = motion.jerk,
          .turn_jerk = motion.turn_jerk,
          .drift = motion.drift,
          .turn_drift = motion.turn_drift,
          .starts_per_s = motion.starts_per_s,
          .stops_per_s = motion.stops_per_s,
          .extrapolation_limit_s = motion.extrapolation_limit_s};
}

void check(const Motion& motion) {
  for (const double value : {motion.jerk, motion.turn_jerk, motion.drift, motion.turn_drift,
                             motion.starts_per_s, motion.stops_per_s, motion.extrapolation_limit_s})
    if (!(value > 0 && std::isfinite(value)))
      throw Error(fmt::format("motion: expected positive numbers, found {}.", value));
}

}  // namespace

std::vector<limn::Body> rooms_of(std::span<const Body> bodies) {
  std::vector<limn::Body> list;
  for (const Body& body : bodies) {
    list.push_back({body.name, {}});
    for (const BodyMarker& marker : body.markers)
      list.back().markers.push_back(
          {{marker.family, marker.id}, marker.size_m, LIMN_VERSIONED::to_room(marker.body_from_marker)});
  }
  check(list);
  return list;
}

std::vector<Body> public_of(const std::vector<limn::Body>& bodies) {
  std::vector<Body> list;
  for (const limn::Body& body : bodies) {
    list.push_back({body.name, {}});
    for (const limn::BodyMarker& marker : body.markers)
      list.back().markers.push_back({marker.marker.family, marker.marker.id, marker.size_m,
                                     LIMN_VERSIONED::to_public(marker.body_from_marker)});
  }
  return list;
}

namespace {

limn::TrackingState to_room(Tracking tracking) {
  switch (tracking) {
    case Tracking::measured:
      return limn::TrackingState::measured;
    case Tracking::extrapolated:
      return limn::TrackingState::extrapolated;
    case Tracking::lost:
      return limn::TrackingState::lost;
  }
  throw Error("track: expected measured, extrapolated or lost, found another number.");
}

}  // namespace

limn::Track room_of(const Track& track) {
  limn::Track out;
  out.body = track.body;
  out.world_from_body = LIMN_VERSIONED::to_room(track.world_from_body);
  for (int i = 0; i < 36; ++i) out.covariance(i / 6, i % 6) = track.covariance[static_cast<std::size_t>(i)];
  if (!out.covariance.allFinite())
    throw Error(
        fmt::format("track of '{}': expected a covariance of finite numbers, found others.", track.body));
  out.marker_count = track.marker_count;
  out.rms_px = track.rms_px;
  out.captured_at = stamp_of(track.captured_at_s);
  out.at = stamp_of(track.at_s);
  out.tracking = to_room(track.tracking);
  return out;
}

Body load_body(const std::filesystem::path& path, const std::string& name) {
  return public_of({{name, value_of(limn::scene::load_marker_file(path))}}).front();
}

std::vector<std::string> families_of(std::span<const Body> bodies) {
  return limn::tracker::families_of(rooms_of(bodies));
}

std::vector<Track> locate_bodies(std::span<const Body> bodies, std::span<const View> views) {
  const RoomViews room = to_room(views);
  return to_public(limn::tracker::observed(rooms_of(bodies), room.views, limn::Stamp{}));
}

struct Tracker::Impl {
  std::vector<limn::Body> bodies;
  limn::tracker::MotionModel motion;
  std::vector<limn::tracker::BodyFilter> filters = {};
};

Tracker::Tracker(std::vector<Body> bodies, const Motion& motion) {
  check(motion);
  impl_ = std::make_unique<Impl>(Impl{rooms_of(bodies), to_room(motion)});
}

Tracker::Tracker(Tracker&&) noexcept = default;
Tracker& Tracker::operator=(Tracker&&) noexcept = default;
Tracker::~Tracker() = default;

void Tracker::update(std::span<const View> views, double captured_at_s) {
  const RoomViews room = to_room(views);
  impl_->filters = limn::tracker::observed(impl_->filters, impl_->bodies, room.views, stamp_of(captured_at_s),
                                           impl_->motion);
}

std::vector<Track> Tracker::predict(double at_s) const {
  return to_public(limn::tracker::predicted(impl_->filters, stamp_of(at_s),
                                            limn::tracker::Prediction::filtered, impl_->motion));
}

}  // namespace limn::LIMN_VERSIONED
