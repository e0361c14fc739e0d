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
  /// Which images shall come, beside the detections.
  enum class Images {
    some,  ///< a few a second; they may be compressed with loss
    all,   ///< each; likewise
    exact  ///< each, without loss, for a calibration
  };
  /// Safe from another thread.
  virtual void want_images(Images images) = 0;
};

}  // namespace limn::tracker
