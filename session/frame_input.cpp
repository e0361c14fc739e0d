#include "session/frame_input.h"

namespace limn::session {

DrawOptions draw_options(const ComposeOptions& options) {
  return {options.marker_light, options.stereo_mm, options.stereo_projectors, options.prepares_lines};
}

// Perception has already predicted with the filter to captured_at; its tracks are reused.
std::vector<Track> predicted_at(const Percepts& percepts, const ComposeOptions& options, Stamp at) {
  if (at == percepts.captured_at && options.prediction == tracker::Prediction::filtered)
    return percepts.tracks;
  return tracker::predicted(percepts.motions, at, options.prediction, options.motion);
}

Prediction predicted_at_capture(const Percepts& percepts, const ComposeOptions& options) {
  const Frame frame = percepts.frames.empty() ? Frame{} : percepts.frames[percepts.screen_camera];
  const Stamp image_at = frame.captured_at != Stamp{} ? frame.captured_at : percepts.captured_at;
  Prediction out;
  out.at_capture = predicted_at(percepts, options, percepts.captured_at);
  out.at_image =
      image_at == percepts.captured_at ? out.at_capture : predicted_at(percepts, options, image_at);
  return out;
}

std::vector<Track> predicted_at_light(const Percepts& percepts,
                                      const ComposeOptions& options,
                                      const FrameTimes& times) {
  return tracker::predicted(percepts.motions, times.shown_at, options.prediction, options.motion, times.now);
}

FrameInput frame_input(const scene::Scene& scene,
                       const ComposeOptions& options,
                       const Percepts& percepts,
                       const scene::ShowState& show_state,
                       const FrameTimes& times) {
  return {percepts, show_state, times,
          scene::assign_tracks(scene, show_state, predicted_at_light(percepts, options, times))};
}

}  // namespace limn::session
