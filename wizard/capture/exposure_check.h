#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/capture.h"
#include "calib/capture_set.h"
#include "core/result.h"

namespace limn::wizard {

/// How a camera sees the light of one projector.
struct ExposureReading {
  std::string camera, projector;
  double lit = 0;        ///< share of the image that is brighter under white than under black
  double saturated = 0;  ///< share of these lit pixels that white saturates
  double bright = 0;     ///< grey level that a tenth of the lit pixels reaches under white
  double blur_px = 0;  ///< standard deviation of the blur of projected edges, camera pixels; 0: no edge found
  std::vector<int> histogram;  ///< grey levels of the lit pixels under white, 256 counts

  /// Sentences that say what is wrong and what to do; empty: nothing is wrong.
  std::vector<std::string> advice() const;
};

/// Evaluates a camera's images (8-bit, of equal size) of a projector's black, white and squares(). Leaves the
/// names empty. Pure.
ExposureReading judged_exposure(const cv::Mat& black, const cv::Mat& white, const cv::Mat& squares);

/// The image of black and white squares that judged_exposure() needs.
cv::Mat squares(int width, int height);

/// Each projector in turn shows its number and colour (for people), then black, white and squares. Returns
/// how every camera sees it, projector by projector. Error: a device fails.
Result<std::vector<ExposureReading>> measure_exposure(const calib::CaptureSet& captures,
                                                      const calib::CaptureBackend& capture);

/// One sentence for each projector that no camera sees; empty: all are seen.
std::vector<std::string> unseen(const std::vector<ExposureReading>& seen);

}  // namespace limn::wizard
