#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/capture.h"
#include "calib/capture_set.h"
#include "core/result.h"

namespace limn::apps {

/// What a camera sees of one projector's light.
struct ExposureReading {
  std::string camera, projector;
  double lit = 0;        ///< share of the image that white makes brighter
  double saturated = 0;  ///< of the lit pixels, under white
  double bright = 0;     ///< grey level that a tenth of the lit pixels exceeds, under white
  double blur_px = 0;    ///< sigma of edges that the projector shows, camera pixels; 0: no edge was seen
  std::vector<int> histogram;  ///< of the lit pixels, under white, 256 levels

  /// What is wrong and what to do about it; empty: nothing.
  std::vector<std::string> advice() const;
};

/// Judges a camera's images (8-bit, of one size) of a projector's black, white and black and white squares
/// (squares()). Pure.
ExposureReading judged_exposure(const cv::Mat& black, const cv::Mat& white, const cv::Mat& squares);

/// The image of squares that judged_exposure() wants.
cv::Mat squares(int width, int height);

/// Each projector in turn shows its number and colour (for people), then black, white and squares; what every
/// camera sees of it, projector by projector. Error: a device fails.
Result<std::vector<ExposureReading>> measured_exposure(const calib::CaptureSet& captures,
                                                       const calib::CaptureBackend& stage);

/// Projectors that no camera sees, a sentence each; empty: all are seen.
std::vector<std::string> unseen(const std::vector<ExposureReading>& seen);

}  // namespace limn::apps
