#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/lens.h"
#include "tracker/candidates.h"
#include "tracker/detection.h"
#include "tracker/edge_bleed.h"
#include "tracker/exclusion_zone.h"
#include "tracker/family.h"
#include "tracker/fork_join.h"
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
  /// How the camera writes light. Wrong, markers shrink, the more the softer their edges; the edges of their
  /// cells show and undo most of it (ink_retreat.h).
  Encoding encoding = Encoding::linear;
  /// Also joins straight edges to quadrilaterals, for markers that fingers, bites or slatted shadows break
  /// up. Costs about half as much again as the rest; left out where no family can_be_covered().
  bool broken_markers = true;
  /// Also fits the whole pattern of markers whose edges blur into each other, as those of small ones do:
  /// their corners are up to ten times better. Costs several times what reading one does; without it their
  /// covariances say so, rather too much than too little.
  bool pattern_fits = true;
  /// How many threads an image is shared out to, of OpenCV's pool (cv::setNumThreads limits them). The
  /// result is the same with any number.
  int threads = 1;
};

/// Finds markers: grey -> local threshold -> boundaries of black regions -> quadrilaterals -> sub-pixel edge
/// lines -> rectified cells -> ids; what is left: straight edges -> quadrilaterals -> the same. Holds its
/// buffers, so keep one per thread.
class Detector {
 public:
  explicit Detector(Families families, DetectorOptions options = {});

  /// `grey` is the camera's raw image: 8-bit, one channel, at most k_max_image_side a side; an empty one
  /// has no markers. With `lens` sides are straight in undistorted directions, without one in the image.
  /// Corners are raw pixels either way.
  std::vector<Detection> detect(const cv::Mat& grey, const Lens* lens = nullptr);

  /// The same into `detections`. Allocates nothing once its buffers are large enough, but what OpenCV's pool
  /// does with several threads.
  void detect(const cv::Mat& grey, const Lens* lens, std::vector<Detection>* detections);

  /// Adds the markers that stand beside the `detections` there are: those of follow() need not be read twice.
  /// Broken ones too where that is an option, unless only Reading::open is asked for.
  void detect_more(const cv::Mat& grey,
                   const Lens* lens,
                   std::vector<Detection>* detections,
                   Reading reading = Reading::covered);

  /// Finds markers again that were at `last`, looking only about there: a marker that moved by more than half
  /// of its side is lost, and new ones want detect_more(). Each square once, in the order of `last`, which
  /// `detections` must not be. A marker that was found by its whole pattern is found by how that looked; it
  /// is read from nothing now and then, and when it looks otherwise. Shadows are looked for anew now and
  /// then, and when the light at a side changes.
  void follow(const cv::Mat& grey,
              const Lens* lens,
              std::span<const Detection> last,
              std::vector<Detection>* detections);

  const Families& families() const { return families_; }

 private:
  Families families_;
  DetectorOptions options_;
  Threshold threshold_;
  CornerCodes corner_codes_;
  QuadFinder finder_;
  std::vector<Quad> quads_;
  struct Worker {
    EdgeRefiner refiner;
    PatternFitBuffers fit;
  };
  std::vector<Worker> workers_;  // one for each of the crew
  SegmentFinder segment_finder_;
  Segments segments_;
  std::vector<ExclusionZone> squares_;  // of markers found before segments are joined
  SegmentQuadFinder segment_quad_finder_;
  std::vector<SegmentQuad> segment_quads_;
  struct Read {
    std::size_t number = 0;  // of its quad
    Detection detection;
    std::optional<EdgeBleed> bleed;
  };
  std::vector<Read> read_;
  std::vector<EdgeBleed> retreats_;  // of those read

  class UnreadQuads;
  std::optional<Read> follow_by_pattern(const cv::Mat& grey, const Lens* lens, const Detection& last);
  std::optional<Read> found_again(const cv::Mat& grey, const Lens* lens, const Detection& last);
  void find_markers(const cv::Mat& grey,
                    const Lens* lens,
                    bool broken,
                    std::vector<Detection>* detections,
                    WorkerTeam& team);
  void read_quads(const cv::Mat& grey, const Lens* lens, Reading reading, UnreadQuads& unread, int worker);
  std::optional<EdgeBleed> add_read(const std::optional<EdgeBleed>& known,
                                    std::vector<Detection>* detections);
  void join_segments(const cv::Mat& grey, const std::vector<Detection>& found, WorkerTeam& team);
  std::optional<Read> read(const cv::Mat& grey,
                           const Quad& quad,
                           const Lens* lens,
                           Reading reading,
                           Worker& worker,
                           const Detection* last = nullptr) const;
  std::optional<PatternAppearance> settle_overlapping_edges(const cv::Mat& grey,
                                                            const Lens* lens,
                                                            const Identity& identity,
                                                            Worker& worker,
                                                            const std::optional<PatternAppearance>& known,
                                                            RefinedQuad* refined) const;
};

}  // namespace limn::tracker
