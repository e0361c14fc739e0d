#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/track.h"
#include "scene/actions.h"
#include "scene/show_state.h"
#include "session/device_health.h"
#include "session/telemetry.h"

namespace limn::session {

/// What the operator's window shows of a session at one moment.
struct OperatorView {
  struct Found {
    std::string marker;  ///< its id
    std::array<Eigen::Vector2d, 4> corners_px;
  };
  struct Image {
    std::string name;
    cv::Mat image;  ///< 8-bit grey or BGR; empty: none yet
    std::vector<Found> found = {};
    bool is_linear = false;  ///< its values are proportional to light
  };
  struct Device {
    DeviceState state;
    std::optional<double> per_second;  ///< image rate by the session's clock; absent: not known yet
  };
  struct Body {
    std::string name;
    std::string markers;         ///< their names; or how many balls
    std::optional<Track> track;  ///< absent: not seen yet
  };
  struct Slot {
    std::string name;
    std::vector<std::string> variants;
    bool is_chosen = false;  ///< keys act on this slot
    bool is_held = false;    ///< its pose is changed by a look or a nudge
  };
  struct Notice {
    double at_s = 0;
    std::string text;
  };
  /// How guests connect (docs/remote.md).
  struct Remote {
    struct Entrance {
      scene::Role role = scene::Role::look;
      std::string pin;
      cv::Mat code;  ///< QR code of the page that pairs without typing
    };
    std::string url;
    std::string fingerprint;            ///< fingerprint of the certificate; empty without TLS
    std::string authority_fingerprint;  ///< fingerprint of /limn.crt; empty without TLS
    std::vector<Entrance> entrances;
    std::string projector = {};             ///< the projector that shows a code; empty: none
    std::vector<std::string> glasses = {};  ///< a line for each guest who wears glasses
  };
  double at_s = 0;  ///< by the session's clock, since the session began
  std::vector<Image> cameras, projectors;
  Image screen;
  std::vector<Device> devices;
  std::vector<Body> bodies;
  std::vector<Slot> slots;
  std::vector<std::string> waiting;       ///< loose markers that may be paired; `pair` uses the last one
  std::vector<std::string> windows = {};  ///< guests whose tablets can be the viewpoint
  /// The guest whose tablet is the viewpoint; empty: the scene's own viewer.
  std::string follows = {};
  scene::ShowState show_state;
  std::vector<ShownFrame> recent;  ///< shown frames, the newest last
  std::vector<Notice> notices;     ///< the newest last
  std::optional<Remote> remote = {};
  std::string moved = {};  ///< devices that have moved; empty: none is known
  bool has_prototype = false;
  std::string deviation_progress = {};      ///< progress of the prototype's scan; empty: none is running
  std::string recalibration_progress = {};  ///< progress of a repair; empty: none is running
};

/// What the operator requests.
struct OperatorAsked {
  struct Code {
    std::string projector;
    scene::Role role = scene::Role::look;
  };
  std::vector<scene::Edit> edits;
  std::optional<Code> code = {};  ///< a code that a projector shall show
  bool ends = false;              ///< whether to end the session
};

}  // namespace limn::session
