#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "core/frame.h"
#include "core/result.h"
#include "core/stereo.h"

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

  /// Whether the device shows an image for each eye of a person who wears stereo glasses.
  virtual bool is_stereo() const { return false; }
  /// As show(), with an image for each eye. Every image has size(), whatever the layout. A device that is not
  /// in stereo shows the left one.
  virtual Result<Stamp> show_eyes(const EyeImages& images) { return show(images.left); }
};

}  // namespace limn::device
