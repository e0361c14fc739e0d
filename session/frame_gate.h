#pragma once

#include <opencv2/core/types.hpp>
#include <optional>
#include <string>

#include "core/frame.h"
#include "core/result.h"
#include "session/device_health.h"
#include "session/source_clock.h"

namespace limn::apps {

/// What a session takes of what one camera sends: images of the size that the rig was measured in, with
/// stamps on the session's clock.
class FrameGate {
 public:
  /// `number`: as `health`, which is borrowed, calls the camera.
  FrameGate(std::string camera, cv::Size size, std::size_t number, DeviceHealth* health);

  /// nullopt: the image cannot be used, and `health` is told why.
  std::optional<Frame> taken(Result<Frame> sent, Stamp now);

  /// Its stamps are of a clock of its own: such sources are played at their pace.
  bool is_of_other_clock() const { return clock_.is_other(); }

 private:
  std::string camera_;
  cv::Size size_;
  std::size_t number_;
  DeviceHealth* health_;
  SourceClock clock_;
};

}  // namespace limn::apps
