#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/imager.h"
#include "core/marker.h"
#include "core/result.h"
#include "core/track.h"
#include "tracker/detector.h"

namespace limn::apps {

/// Where a guest's camera was when it took a picture.
struct GuestSight {
  /// The camera with its lens as far as it is known, and its place; none: `why` says what to do.
  std::optional<Imager> view;
  std::string why;
  int markers = 0;    ///< that the place rests on
  double rms_px = 0;  ///< of their corners, each
  /// Of the lens: one standard deviation of its focal length, and the pictures that it was found in.
  double focal_stddev_px = 0;
  int lens_frames = 0;
};

/// Finds a guest's camera by the markers in its pictures, without knowing its lens at first. One a device.
/// Pure: the same pictures give the same answers.
class GuestEye {
 public:
  explicit GuestEye(tracker::Families families);

  /// `bgr` is a whole picture, sRGB. `bodies` are what markers stand on, `tracks` where those are; a body
  /// without a track, or with a lost one, is not to be gone by.
  GuestSight look(const cv::Mat& bgr, std::span<const Body> bodies, std::span<const Track> tracks);

 private:
  tracker::Detector detector_;
  std::vector<tracker::Detection> detections_, followed_;
  int pictures_ = 0;
  std::optional<Pose> last_;  // camera_from_world, of the picture before
};

}  // namespace limn::apps
