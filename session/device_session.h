#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "core/result.h"
#include "device/camera_source.h"
#include "device/display.h"
#include "device/key_source.h"
#include "session/device_health.h"
#include "session/frame_loop.h"
#include "session/keys.h"

namespace limn::apps {

/// Opened devices of a session, which takes the cameras with it. A camera that is missing at first, or a
/// display, is null: the session goes on without it.
struct SessionDevices {
  std::vector<std::unique_ptr<device::CameraSource>> cameras;  ///< of the rig's names
  std::vector<std::unique_ptr<device::Display>> projectors;    ///< in the rig's order
  std::vector<std::unique_ptr<device::Display>> screens;       ///< show what ShowState::screen says
  std::vector<device::KeySource> keys = {};
  std::vector<DeviceState> missing = {};  ///< what could not be opened, and why
  Keys* chosen = nullptr;                 ///< what keys do, shared with the operator's; null: their own
};

/// Plays a session on devices, in real time, until `seconds` are over (0: no end), `is_ended`, or a client
/// ends it; at least a camera and a projector must be there. A thread for each camera takes its newest frame,
/// one thread perceives, this one (its GL context current) runs the frame loop. Newest wins, nothing queues:
/// what was not taken in time is dropped and counted. Devices that fail are told of, once, and tried again.
/// Sources with stamps of their own (images, videos) are played at their pace.
Status play_on_devices(SessionDevices* devices,
                       double seconds,
                       const std::atomic<bool>& is_ended,
                       const SessionParts& parts);

/// Error: no camera that works, or no projector.
Status check_devices(const SessionDevices& devices);

}  // namespace limn::apps
