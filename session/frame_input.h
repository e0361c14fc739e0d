#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/track.h"
#include "scene/show_state.h"
#include "session/drawing/frame_drawer.h"
#include "session/perception.h"
#include "tracker/marker_light.h"
#include "tracker/predict.h"

namespace limn::session {

struct ComposeOptions {
  tracker::Prediction prediction = tracker::Prediction::filtered;
  tracker::MotionModel motion;  ///< the same as PerceptionOptions::motion
  tracker::MarkerLight marker_light = tracker::MarkerLight::keep_out;
  double fade_s = 0.15;   ///< fade-out time of a part whose marker is lost
  double label_s = 1.2;   ///< how long a variant's name is shown beside its marker
  double lost_s = 1.5;    ///< how long a ring marks where a part was lost
  double stereo_mm = 63;  ///< between the eyes of a person before a screen or projector in stereo
  /// Projectors whose images are drawn for each eye of the viewer, by name.
  std::vector<std::string> stereo_projectors = {};
  bool refill = true;           ///< other projectors fill in light that a shadow blocks
  bool prepares_lines = false;  ///< DrawOptions::prepares_lines; for sessions in which lines may be drawn
  /// The images that screens show are proportional to light; they are converted to sRGB for screens.
  bool is_linear_camera = false;
};

/// The options that the drawing of a described frame needs.
DrawOptions draw_options(const ComposeOptions& options);

/// Position of the tablet camera of a guest with a name, found from the tablet's own image; world frame, m.
struct TabletViewpoint {
  std::string guest;
  Eigen::Vector3d p_eye_world = Eigen::Vector3d::Zero();
  Stamp at;  ///< when it became known
};
/// Older tablet positions are not used; seconds.
constexpr double k_guest_place_lasts_s = 1;

/// The moments of a frame.
struct FrameTimes {
  Stamp now;       ///< when it is composed; decides what counts as lost
  Stamp shown_at;  ///< when its light arrives
};

/// The tracks at the moments that matter to one frame, each predicted once. Markers are not yet assigned to
/// slots (scene::assign_tracks).
struct Prediction {
  /// At the newest camera frame. They decide whether a pin's marker has moved.
  std::vector<Track> at_capture;
  /// At the newest image of Percepts::screen_camera, which screens and tablets draw over. With several
  /// cameras this differs from at_capture: drawn for any other moment, parts would lie beside what that image
  /// shows.
  std::vector<Track> at_image;
  std::vector<Track> at_light;  ///< at FrameTimes::shown_at
};

/// The predictions that need only percepts: at_capture and at_image.
Prediction predicted_at_capture(const Percepts& percepts, const ComposeOptions& options);
/// Prediction::at_light.
std::vector<Track> predicted_at_light(const Percepts& percepts,
                                      const ComposeOptions& options,
                                      const FrameTimes& times);

/// The input for composing one frame. Borrows what it refers to.
struct FrameInput {
  const Percepts& percepts;
  const scene::ShowState& show_state;
  FrameTimes times;
  std::vector<Track> tracks;  ///< Prediction::at_light, assigned to slots as the show state pairs markers
  std::span<const TabletViewpoint> places = {};  ///< tablets that the viewpoint depends on
  /// Projectors that give no light now, by name. Others that reach their places give it instead.
  std::span<const std::string> dark_projectors = {};
};

/// The tracks at any moment near the last capture.
std::vector<Track> predicted_at(const Percepts& percepts, const ComposeOptions& options, Stamp at);

/// Makes a FrameInput without a Session.
FrameInput frame_input(const scene::Scene& scene,
                       const ComposeOptions& options,
                       const Percepts& percepts,
                       const scene::ShowState& show_state,
                       const FrameTimes& times);

}  // namespace limn::session
