#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/lens.h"
#include "tracker/candidates.h"
#include "tracker/detection.h"
#include "tracker/family.h"
#include "tracker/refine.h"
#include "tracker/threshold.h"

namespace limn::tracker {

struct DetectorOptions {
  /// Grey levels between black and white below which there is no marker. Lower finds markers in the dark and
  /// costs time in noise; noise of 2 levels needs 12.
  int min_contrast = 16;
  /// Smallest side, as CandidateOptions.
  double min_side_px = 6;
  /// How the camera writes light. Wrong, markers shrink, the more the softer their edges.
  Encoding encoding = Encoding::linear;
};

/// Finds markers: grey -> local threshold -> boundaries of black regions -> quadrilaterals -> sub-pixel edge
/// lines -> rectified cells -> ids. Holds its buffers, so keep one per thread.
class Detector {
 public:
  explicit Detector(Families families, DetectorOptions options = {})
      : families_(std::move(families)), options_(options), refiner_(options.encoding) {}

  /// `grey` is 8-bit, one channel, the camera's raw picture; an empty one has no markers. With `lens` sides
  /// are straight in undistorted directions, without one in the picture. Corners are raw pixels either way.
  std::vector<Detection> detect(const cv::Mat& grey, const Lens* lens = nullptr);

  const Families& families() const { return families_; }

 private:
  Families families_;
  DetectorOptions options_;
  Threshold threshold_;
  BinaryPicture binary_;
  QuadFinder finder_;
  std::vector<Quad> quads_;
  EdgeRefiner refiner_;
};

}  // namespace limn::tracker
