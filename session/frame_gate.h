#pragma once

#include <opencv2/core/types.hpp>
#include <optional>
#include <string>

#include "core/frame.h"
#include "core/result.h"
#include "device/source_clock.h"
#include "session/device_health.h"

namespace limn::session {

/// Checks the frames of one camera: accepts images of the size that the rig was calibrated with, and converts
/// their stamps to the session's clock.
class FrameGate {
 public:
  /// `number`: the camera's number in `health`, which is borrowed.
  FrameGate(std::string camera, cv::Size size, std::size_t number, DeviceHealth* health);

  /// The accepted frame. nullopt: the image cannot be used; the reason is reported to `health`.
  std::optional<Frame> taken(Result<Frame> sent, Stamp now);

  /// Whether its stamps come from another clock than the session's; such sources are played at their own
  /// pace.
  bool is_of_other_clock() const { return clock_.is_other(); }

 private:
  std::string camera_;
  cv::Size size_;
  std::size_t number_;
  DeviceHealth* health_;
  device::SourceClock clock_;
};

}  // namespace limn::session
