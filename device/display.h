#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "core/frame.h"
#include "core/result.h"

namespace limn::device {

/// A device that images are shown on: a projector, a screen, a virtual projector.
class Display {
 public:
  virtual ~Display() = default;

  /// The device's name (`projector0`).
  virtual const std::string& name() const = 0;
  /// Width and height that every image must have.
  virtual cv::Size size() const = 0;
  /// Shows an 8-bit grey or BGR image until the next call. Returns the moment at which its light leaves the
  /// device (`shown_at`), which may be in the future. Error when the image's size or type is wrong or the
  /// device is gone.
  virtual Result<Stamp> show(const cv::Mat& image) = 0;
};

}  // namespace limn::device
