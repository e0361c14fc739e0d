#pragma once

#include <opencv2/core/types.hpp>
#include <string>

#include "core/frame.h"
#include "core/result.h"

namespace limn::device {

/// Where frames come from: a real camera, a folder of pictures, the virtual rig.
class CameraSource {
 public:
  virtual ~CameraSource() = default;

  /// The name its frames carry (`camera0`).
  virtual const std::string& name() const = 0;
  /// Width and height of every frame.
  virtual cv::Size size() const = 0;
  /// Waits for the next frame. `captured_at` is the middle of its exposure as well as the source knows it.
  /// An error ends the stream: a lost device, or a finite source at its end.
  virtual Result<Frame> next() = 0;
};

}  // namespace limn::device
