#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/wall.h"
#include "device/camera_source.h"
#include "device/display.h"
#include "device/key_source.h"
#include "session/device_health.h"
#include "session/frame_loop.h"
#include "session/requests/keys.h"

namespace limn::session {

/// The opened devices of a session. The session takes ownership of the cameras. A camera or display that
/// could not be opened is null; the session runs without it.
struct SessionDevices {
  std::vector<std::unique_ptr<device::CameraSource>> cameras;  ///< named as in the rig
  std::vector<std::unique_ptr<device::Display>> projectors;    ///< in the rig's order
  std::vector<double> latency_s = {};                          ///< that their stamps contain; empty: none
  std::vector<std::unique_ptr<device::Display>> screens;       ///< each shows what scene::screen_content says
  std::map<std::string, Wall> walls = {};                      ///< screens with a place in the world, by name
  std::vector<device::KeySource> keys = {};
  std::vector<DeviceState> missing = {};  ///< what could not be opened, and why
  /// Key bindings and chosen slot, shared with the operator console; null: the keys get their own.
  Keys* chosen = nullptr;
};

/// Runs a session on devices in real time until `seconds` have passed (0: no limit), `is_ended` is set, or a
/// client ends it. At least one camera and one projector must work. Each camera has a thread that reads its
/// frames, one thread runs perception, and the calling thread (its GL context current) runs the frame loop.
/// Nothing is queued: only the newest frame is kept, and a frame that is not used in time is dropped and
/// counted. A device that fails is reported once and tried again. Sources with stamps of their own (image
/// files, videos) are played at their own pace.
Status play_on_devices(SessionDevices* devices,
                       double seconds,
                       const std::atomic<bool>& is_ended,
                       const SessionParts& parts);

/// Error: no camera works, or no projector works.
Status check_devices(const SessionDevices& devices);

}  // namespace limn::session
