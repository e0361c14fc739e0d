#include "session/frame_input.h"

namespace limn::apps {
namespace {

// Perception has already predicted with the filter to captured_at; its tracks are reused.
std::vector<Track> tracks_at(const Percepts& watched, const ComposeOptions& options, Stamp at) {
  if (at == watched.captured_at && options.prediction == tracker::Prediction::filtered) return watched.tracks;
  return tracker::predicted(watched.motions, at, options.prediction, options.motion);
}

}  // namespace

Prediction predicted_at_capture(const Percepts& watched, const ComposeOptions& options) {
  const bool has_image = !watched.frames.empty() && watched.frames[0].captured_at != Stamp{};
  const Stamp image_at = has_image ? watched.frames[0].captured_at : watched.captured_at;
  Prediction out;
  out.at_capture = tracks_at(watched, options, watched.captured_at);
  out.at_image = image_at == watched.captured_at ? out.at_capture : tracks_at(watched, options, image_at);
  return out;
}

std::vector<Track> predicted_at_light(const Percepts& watched,
                                      const ComposeOptions& options,
                                      const FrameTimes& times) {
  return tracker::predicted(watched.motions, times.shown_at, options.prediction, options.motion, times.now);
}

FrameInput frame_input(const scene::Scene& scene,
                       const ComposeOptions& options,
                       const Percepts& watched,
                       const scene::ShowState& show_state,
                       const FrameTimes& times) {
  return {watched, show_state, times,
          scene::assign_tracks(scene, show_state, predicted_at_light(watched, options, times))};
}

}  // namespace limn::apps
