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

namespace limn::apps {

/// What the operator sees of a session at a moment.
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
    std::optional<double> per_second;  ///< images, by the session's clock; none yet: absent
  };
  struct Body {
    std::string name;
    std::string markers;         ///< their names
    std::optional<Track> track;  ///< absent: not seen yet
  };
  struct Slot {
    std::string name;
    std::vector<std::string> variants;
    bool is_chosen = false;  ///< the keys' slot
    bool is_held = false;    ///< by a look or a nudge, not where its marker puts it
  };
  struct Notice {
    double at_s = 0;
    std::string text;
  };
  /// How guests come in (docs/remote.md).
  struct Remote {
    struct Entrance {
      std::string role, pin;
      cv::Mat code;  ///< QR code of the page that pairs by itself
    };
    std::string url;
    std::string fingerprint;            ///< of the certificate; empty without
    std::string authority_fingerprint;  ///< of /limn.crt, likewise
    std::vector<Entrance> entrances;
    std::string projector = {};  ///< that shows a code; empty: none
  };
  double at_s = 0;  ///< of the session's clock, since it began
  std::vector<Image> cameras, projectors;
  Image screen;
  std::vector<Device> devices;
  std::vector<Body> bodies;
  std::vector<Slot> slots;
  std::vector<std::string> waiting;       ///< loose markers that may carry a part, the next one last
  std::vector<std::string> windows = {};  ///< guests whose tablets can be the eye
  std::string follows = {};               ///< the one whose tablet it is; empty: the scene's own viewer
  scene::ShowState show_state;
  std::vector<ShownFrame> recent;  ///< images shown, the newest last
  std::vector<Notice> notices;     ///< the newest last
  std::optional<Remote> remote = {};
  std::string moved = {};  ///< devices that do not stand where the rig says; empty: none is known of
  std::string recalibration_progress = {};  ///< how far a repair is; empty: there is none
};

/// What a person asked for.
struct OperatorAsked {
  struct Code {
    std::string projector, role;
  };
  std::vector<scene::Edit> edits;
  std::optional<Code> code = {};  ///< that a projector is to show
  bool ends = false;              ///< the session
};

}  // namespace limn::apps
