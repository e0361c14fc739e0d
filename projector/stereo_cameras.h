#pragma once

#include <array>
#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "core/rig.h"
#include "core/stereo.h"

namespace limn::projector {

/// Two cameras of a rig whose images a person can look at with one eye each. Their images are rectified: both
/// are shown as pinhole cameras would see that look in one direction with the base line along their rows, so
/// that a point is in the same row of both.
class StereoCameras {
 public:
  /// Chooses the two cameras with the shortest base line, of those whose base line is longer than 5 mm and
  /// lies within 30 degrees of both images' rows, that look within 40 degrees of each other, and that see
  /// visible light. nullopt: there are no such two.
  static std::optional<StereoCameras> chosen(const Rig& rig);

  /// Index in the rig of the left and the right eye's camera.
  const std::array<std::size_t, 2>& cameras() const { return cameras_; }
  /// The pinhole cameras of the rectified images. Where the cameras' axes pass each other a point has the
  /// same column in both images, too: it appears in the plane of the screen.
  const std::array<Imager, 2>& eyes() const { return eyes_; }
  /// The rectified images of the two cameras' images. Black where a camera sees nothing.
  EyeImages rectified(const EyeImages& images) const;

 private:
  StereoCameras() = default;
  std::array<std::size_t, 2> cameras_ = {};
  std::array<Imager, 2> eyes_;
  std::array<cv::Mat, 2> maps_;  // CV_32FC2: pixel of the camera for each pixel of the eye
};

}  // namespace limn::projector
