#pragma once

#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/result.h"

namespace limn::device {

/// One thing that was asked of a camera, and what came of it.
struct CameraSetting {
  std::string name;  ///< with its unit: `exposure_ms`
  double asked = 0;
  std::optional<double> found;  ///< as the device reports it after setting; nullopt: it cannot be read
  std::string problem;          ///< a sentence, where the device did not do as asked; else empty
};

/// Where frames come from: a real camera, a folder of images, the virtual rig.
class CameraSource {
 public:
  virtual ~CameraSource() = default;

  /// The name its frames carry (`camera0`).
  virtual const std::string& name() const = 0;
  /// Width and height of every frame.
  virtual cv::Size size() const = 0;
  /// Waits for the next frame. `captured_at` is the middle of its exposure as well as the source knows it.
  /// An error ends the stream of a finite source (is_finite()). Any other source waits for a limited time,
  /// says why no frame came, and tries again at the next call.
  virtual Result<Frame> next() = 0;

  /// Whether it ends by itself: stored images, a video file.
  virtual bool is_finite() const { return false; }
  /// What is known of it, for people, in one line: how it is read, what was lost so far.
  virtual std::string description() const { return {}; }
  /// What was asked of it, and what it says it does.
  virtual std::vector<CameraSetting> settings() const { return {}; }
};

}  // namespace limn::device
