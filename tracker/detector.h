#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/lens.h"
#include "tracker/candidates.h"
#include "tracker/detection.h"
#include "tracker/family.h"
#include "tracker/identify.h"
#include "tracker/refine.h"
#include "tracker/segment_quads.h"
#include "tracker/segments.h"
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
  /// Also joins straight edges to quadrilaterals, for markers that fingers, bites or slatted shadows break
  /// up. Costs about as much again as the rest.
  bool broken_markers = true;
};

/// Finds markers: grey -> local threshold -> boundaries of black regions -> quadrilaterals -> sub-pixel edge
/// lines -> rectified cells -> ids; what is left: straight edges -> quadrilaterals -> the same. Holds its
/// buffers, so keep one per thread.
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
  CornerCodes corner_codes_;
  QuadFinder finder_;
  std::vector<Quad> quads_;
  EdgeRefiner refiner_;
  std::vector<std::array<Eigen::Vector2d, 4>> known_;  // outlines of what is found already
  SegmentFinder segment_finder_;
  std::vector<Segment> segments_;
  SegmentQuadFinder joiner_;
  std::vector<SegmentQuad> joined_;

  std::optional<Detection> read(const cv::Mat& grey, const Quad& quad, const Lens* lens, Reading reading);
  void settle_overlapping_edges(const cv::Mat& grey, const Identity& identity, RefinedQuad* refined) const;
  void add_broken(const cv::Mat& grey, const Lens* lens, std::vector<Detection>* detections);
};

}  // namespace limn::tracker
