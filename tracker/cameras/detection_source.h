#pragma once

#include <optional>

#include "core/result.h"
#include "tracker/cameras/camera_detections.h"

namespace limn::tracker {

/// A camera in whose images another machine detects: an interface beside device::CameraSource.
class DetectionSource {
 public:
  /// What has come.
  struct Output {
    std::optional<CameraDetections> detections = {};
    std::optional<Frame> image = {};
  };
  virtual ~DetectionSource() = default;
  /// Waits a tenth of a second for the next detections or image; both may be absent. Stamps are on this
  /// machine's clock. Error: why there have been none for long.
  virtual Result<Output> next_output() = 0;
  /// Whether every image shall come; otherwise some in a second do. Safe from another thread.
  virtual void want_every_image(bool is_wanted) = 0;
};

}  // namespace limn::tracker
