#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/track.h"
#include "scene/show_state.h"
#include "session/perception.h"
#include "tracker/marker_light.h"
#include "tracker/predict.h"

namespace limn::apps {

struct ComposeOptions {
  tracker::Prediction prediction = tracker::Prediction::filtered;
  tracker::MotionModel motion;  ///< as the Watcher's
  tracker::MarkerLight marker_light = tracker::MarkerLight::keep_out;
  double fade_s = 0.15;   ///< in which a part's light goes when its marker is lost
  double label_s = 1.2;   ///< for which a variant's name stands by its marker
  double lost_s = 1.5;    ///< for which a ring marks where a part was lost
  double stereo_mm = 63;  ///< between the eyes of Screen::stereo
  bool refill = true;     ///< light lost to a shadow is given by other projectors
  /// Camera 0's images are proportional to light; a screen's are made of them as sRGB.
  bool is_linear_camera = false;
};

/// Where a guest's tablet looks from, by its own image; the guest has a name.
struct TabletViewpoint {
  std::string guest;
  Eigen::Vector3d p_eye_world = Eigen::Vector3d::Zero();
  Stamp at;  ///< when it became known
};
/// A place as old as this is no guest's any more.
constexpr double k_guest_place_lasts_s = 1;

/// The moments of a frame.
struct FrameTimes {
  Stamp now;       ///< it is composed, and what is lost is judged
  Stamp shown_at;  ///< its light arrives
};

/// Where bodies are at the moments that matter to one frame, each predicted once. Bodies are not yet paired
/// with slots (scene::carried).
struct Prediction {
  std::vector<Track> at_capture;  ///< of the newest camera frame: a pin holds until its marker has moved
  /// Of camera 0's newest image, which screens and tablets draw over. With several cameras this is a moment
  /// of its own: drawn for any other, parts would lie beside what that image shows.
  std::vector<Track> at_image;
  std::vector<Track> at_light;  ///< FrameTimes::shown_at
};

/// What is known as soon as frames were perceived: at_capture and at_image.
Prediction predicted_at_capture(const Percepts& watched, const ComposeOptions& options);
/// Prediction::at_light.
std::vector<Track> predicted_at_light(const Percepts& watched,
                                      const ComposeOptions& options,
                                      const FrameTimes& times);

/// What one frame is composed of. Borrows what it refers to.
struct FrameInput {
  const Percepts& watched;
  const scene::ShowState& show_state;
  FrameTimes times;
  std::vector<Track> tracks;  ///< Prediction::at_light, carried as the show state pairs markers
  std::span<const TabletViewpoint> places = {};  ///< whose light goes by guests' eyes
};

/// The same from its beginnings, for who has no Session.
FrameInput frame_input(const scene::Scene& scene,
                       const ComposeOptions& options,
                       const Percepts& watched,
                       const scene::ShowState& show_state,
                       const FrameTimes& times);

}  // namespace limn::apps
