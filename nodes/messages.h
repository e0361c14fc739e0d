#pragma once

#include <compare>
#include <cstdint>
#include <opencv2/core/types.hpp>
#include <string>
#include <variant>
#include <vector>

#include "core/frame.h"
#include "session/drawing/frame_description.h"
#include "tracker/cameras/camera_detections.h"

namespace limn::nodes {

/// The version of the messages below. Machines with different versions do not work together; each names the
/// other.
inline constexpr int k_protocol = 2;

/// Identifies a message's sender: a program that runs on a machine.
struct Sender {
  std::string node;       ///< the machine's name in the room
  std::uint64_t run = 0;  ///< a random number that the program chooses when it starts

  auto operator<=>(const Sender&) const = default;
};

/// A monitor or camera that a machine offers, by the name that the machine knows it by.
struct OfferedDevice {
  std::string name;
  cv::Size size;  ///< pixels; empty: not known before it is opened

  bool operator==(const OfferedDevice&) const = default;
};

/// What a machine is and has. Reliable; who comes late gets the last one of each machine.
struct Offer {
  bool is_host = false;  ///< it tracks and decides; a room has one
  int protocol = k_protocol;
  std::string version = {};   ///< the program's
  std::string renderer = {};  ///< the OpenGL driver's name; empty: it draws nothing
  std::vector<OfferedDevice> monitors = {}, cameras = {};
  /// The host's file server: "ADDRESS:PORT" for each of its addresses, and the SHA-256 of its certificate.
  std::vector<std::string> servers = {};
  std::string fingerprint = {};
  std::string token = {};  ///< that its file server wants to see

  bool operator==(const Offer&) const = default;
};

/// A file that all machines need, named by its content.
struct SharedFile {
  std::string path;    ///< relative to the session's folder: "rig/rig.json", "scene/door.glb"
  std::string sha256;  ///< 64 hexadecimal digits
  std::uint64_t bytes = 0;

  bool operator==(const SharedFile&) const = default;
};

/// The session, from the host. Reliable; who comes late gets the last one.
struct Setup {
  std::uint64_t revision = 0;  ///< increases with each change
  std::string devices = {};    ///< the devices at nodes (device::devices_text)
  std::vector<SharedFile> files = {};
};

/// One frame, from the host. Best effort; the newest wins.
struct Moment {
  std::uint64_t setup = 0;          ///< the Setup::revision that it was made for
  session::FrameDescription frame;  ///< stamps of the host's clock
};

/// What a screen at a node shows, from the host. Best effort; the newest of each screen wins.
struct ScreenImage {
  std::string to = {};      ///< the node
  std::string screen = {};  ///< its name in the setup's devices
  std::uint64_t number = 0;
  std::string left = {}, right = {};  ///< JPEG for each eye; no right one: both eyes get the left one
};

/// Asks another machine for its time. Best effort.
struct ClockRequest {
  std::string to;  ///< the machine
  std::uint64_t number = 0;
  Stamp sent_at;  ///< on the asking machine's clock
};

/// The answer to a ClockRequest. Best effort.
struct ClockAnswer {
  std::string to;
  std::uint64_t number = 0;
  Stamp asked_at;     ///< ClockRequest::sent_at
  Stamp received_at;  ///< both on the answering machine's clock
  Stamp sent_at;
};

/// Asks a node to do something. Reliable; answered by an Answer with the same number.
struct Order {
  enum class What {
    open_display,
    show,  ///< shows `image`
    open_camera,
    grab,    ///< answers the next image; with `at`, one that was exposed later
    preview  ///< likewise, as a JPEG that need not be exact
  };
  std::string to = {};
  std::uint64_t number = 0;
  What what = What::show;
  std::string device = {};  ///< the display or camera (device::devices_text)
  std::string image = {};   ///< PNG
  Stamp at = {};            ///< on the host's clock
};

struct Answer {
  std::string to = {};
  std::uint64_t number = 0;
  std::string error = {};  ///< empty: it was done
  cv::Size size = {};
  std::string image = {};  ///< PNG, a JPEG as the camera sent it, or one made for a preview
  Stamp at = {};           ///< when it was shown or exposed, on the host's clock
};

/// When a display refreshes: at a known moment, and each period before and after.
struct Refresh {
  Stamp at;  ///< light of an image that it showed, on the host's clock
  double period_s = 0;

  bool operator==(const Refresh&) const = default;
};

/// How a node does, a few times a second. Best effort.
struct Health {
  std::uint64_t shown = 0;   ///< number of the last frame shown
  std::uint64_t missed = 0;  ///< frames that came but were not shown in time
  double latency_s = 0;      ///< from the call that shows an image to its light, as measured recently
  double draw_ms = 0;
  double late_ms = 0;         ///< the largest distance from shown_at recently
  double clock_offset_s = 0;  ///< host clock minus the node's
  double clock_stddev_s = 0;
  std::vector<std::string> problems;  ///< sentences for people; empty: all is well
  bool has_no_host = false;           ///< it has been in the room for long enough to know
  std::vector<Refresh> refreshes;     ///< those of its projectors that are known
  /// Likewise of screens; each begins with the screen's name. The projectors work nevertheless.
  std::vector<std::string> screen_problems = {};
};

/// What an image of a node's camera shows. Best effort; the newest of each camera wins.
struct Detections {
  std::uint64_t setup = 0;          ///< the Setup::revision whose markers and lens were used
  tracker::CameraDetections found;  ///< stamps of the host's clock
};

/// The sender has gone: it said so, or was not heard for as long as its liveliness lasts. Made by the link.
struct Departure {};

using Message = std::variant<Offer,
                             Setup,
                             Moment,
                             ScreenImage,
                             ClockRequest,
                             ClockAnswer,
                             Order,
                             Answer,
                             Health,
                             Detections,
                             Departure>;

}  // namespace limn::nodes
