#pragma once

#include <filesystem>
#include <string>

#include "core/result.h"

namespace limn::apps {

struct LiveOptions {
  std::filesystem::path rig;      ///< empty: the virtual world's true one
  std::filesystem::path scene;    ///< empty: the virtual world's
  std::filesystem::path devices;  ///< limn.devices/1; empty: the virtual rig
  std::filesystem::path world;    ///< of the virtual rig; empty: a room made for rig and scene
  std::filesystem::path script;
  double seconds = 0;                ///< of the session's clock; 0: until it is ended
  double resolution = 1;             ///< share of the virtual cameras' and projectors' pixels a side
  double frame_period_s = 1 / 30.0;  ///< of the virtual rig's cameras
  std::filesystem::path record;
  std::filesystem::path out;
  bool window = false;
  std::string prediction = "filtered";
  std::string marker_light = "keep-out";
  bool refill = true;          ///< light lost to a shadow is given by other projectors
  double extrapolate_s = 0.3;  ///< for which unseen markers are carried on
  std::string osc;             ///< PORT or ADDRESS:PORT where other programs are heard; empty: not
  std::string osc_to;          ///< HOST:PORT that is told what changes; empty: nobody
  std::string serve;           ///< PORT or ADDRESS:PORT of the remote (docs/remote.md); empty: none
  std::string serve_show;      ///< projector that shows the remote's code at first; empty: none
  bool json = false;
};

/// `limn live`, on devices or on the virtual rig: cameras -> tracker -> prediction to the photon ->
/// projectors and a screen, until the window is closed, a signal comes or the time is over. With `out`:
/// poses.csv, telemetry.csv, session.json, session.html and the last images. Prints what was measured.
Status run_live(const LiveOptions& options);

}  // namespace limn::apps
