#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/room.h"
#include "core/result.h"
#include "tracker/balls/constellation_filter.h"
#include "tracker/marker_light.h"
#include "tracker/predict.h"

namespace limn::apps {

struct LiveOptions {
  std::filesystem::path rig;      ///< Empty: the virtual world's true rig.
  std::filesystem::path scene;    ///< Empty: the virtual world's scene.
  std::filesystem::path devices;  ///< limn.devices/1; empty: the virtual rig.
  std::filesystem::path world;    ///< World of the virtual rig; empty: a room made for rig and scene.
  std::filesystem::path script;
  double seconds = 0;  ///< Length on the session's clock; 0: until somebody ends it.
  /// Scale of the virtual devices' image sides, over 0 and at most 1. Without it: 1; in real time what this
  /// machine can compute.
  std::optional<double> resolution;
  bool is_real_time = false;         ///< The virtual rig's clock runs as a clock on the wall.
  double frame_period_s = 1 / 30.0;  ///< Frame period of the virtual rig's cameras.
  std::filesystem::path record;
  std::filesystem::path out;
  bool window = false;
  tracker::Prediction prediction = tracker::Prediction::filtered;
  tracker::MarkerLight marker_light = tracker::MarkerLight::keep_out;
  tracker::TriplePose triple_pose = tracker::TriplePose::refined;
  std::vector<std::string> stereo;     ///< Projectors of the virtual rig that show an image to each eye.
  bool refill = true;                  ///< Other projectors fill shadows.
  double extrapolate_s = 0.3;          ///< How long unseen markers are extrapolated.
  std::string osc;                     ///< PORT or ADDRESS:PORT at which OSC is received; empty: none.
  std::string osc_from;                ///< The only address whose OSC messages are accepted; empty: all.
  std::string osc_to;                  ///< HOST:PORT to which changes are sent by OSC; empty: none.
  std::filesystem::path trackers;      ///< limn.trackers/1: other tracking systems; empty: none.
  std::vector<std::string> poses_out;  ///< PROTOCOL:HOST:PORT or ros each, to which poses are sent.
  std::string serve;                   ///< PORT or ADDRESS:PORT of the remote (docs/remote.md); empty: none.
  std::string serve_show;              ///< Projector that shows the remote's code at first; empty: none.
  RoomOptions room;                    ///< With devices: the room whose nodes have some of them.
  bool json = false;
};

/// `limn live`, on devices or on the virtual rig: cameras -> tracker -> prediction to the moment of light ->
/// projectors and a screen, until the window is closed, a signal comes or the time is over. With `out` it
/// writes poses.csv, telemetry.csv, session.json, session.html and the last images. Prints the measurements.
Status run_live(const LiveOptions& options);

/// Whether a signal has ended the newest session of run_live().
bool live_was_ended_by_signal();

}  // namespace limn::apps
