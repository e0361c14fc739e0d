#pragma once

#include <optional>

#include "core/result.h"
#include "tracker/cameras/camera_detections.h"

namespace limn::tracker {

/// A camera in whose images another machine detects: an interface beside device::CameraSource.
class DetectionSource {
 public:
  /// What has come; at least one of them.
  struct Output {
    std::optional<CameraDetections> detections = {};
    std::optional<Frame> image = {};
  };
  virtual ~DetectionSource() = default;
  /// Waits for the next detections or image, for a limited time. Stamps are on this machine's clock. Error:
  /// why none came.
  virtual Result<Output> next_output() = 0;
  /// Whether every image shall come; otherwise some in a second do. Safe from another thread.
  virtual void want_every_image(bool is_wanted) = 0;
};

}  // namespace limn::tracker
