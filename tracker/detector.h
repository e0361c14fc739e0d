#pragma once

#include <array>
#include <memory>
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
  /// Smallest difference between black and white in grey levels. A lower value finds markers in the dark and
  /// costs time in noise; noise of 2 levels needs 12.
  int min_contrast = 16;
  /// Smallest side, as in CandidateOptions.
  double min_side_px = 6;
  /// How the camera encodes light as grey levels. With the wrong value markers appear too small, the more the
  /// softer their edges are; the correction by the edges of their cells removes most of that (edge_bleed.h).
  Encoding encoding = Encoding::linear;
  /// Also joins straight edges to quadrilaterals, to find markers that are broken up by fingers, bites or
  /// slatted shadows. Costs about half as much again as the rest. Codes of which no cell can be covered
  /// (!can_be_covered()) are read with one broken side of the border.
  bool broken_markers = true;
  /// Also fits the whole pattern of markers whose edges blur into each other, which is common for small ones:
  /// their corners become up to ten times better. A fit costs several times what reading a marker costs.
  /// Without it the corners' covariances are larger accordingly, rather too large than too small.
  bool pattern_fits = true;
  /// Number of threads of OpenCV's pool that work on one image (cv::setNumThreads limits them). The result
  /// does not depend on it.
  int threads = 1;
};

/// Finds markers: grey -> local threshold -> boundaries of black regions -> quadrilaterals -> sub-pixel edge
/// lines -> rectified cells -> ids. Light squares on dark are found likewise in the inverted image, if a
/// family has such markers. In the rest of the image: straight edges -> quadrilaterals -> the same. Holds its
/// buffers, so use one for each thread.
class Detector {
 public:
  explicit Detector(Families families, DetectorOptions options = {});

  /// `grey` is the camera's raw image: 8-bit, one channel, at most k_max_image_side a side. An empty image
  /// has no markers. With `lens` a marker's sides are straight in undistorted directions, without it they are
  /// straight in the image. Corners are pixels of the raw image in both cases.
  std::vector<Detection> detect(const cv::Mat& grey, const Lens* lens = nullptr);

  /// The same, with the result in `detections`. Allocates nothing once its buffers are large enough, except
  /// in OpenCV's pool with several threads.
  void detect(const cv::Mat& grey, const Lens* lens, std::vector<Detection>* detections);

  /// Adds the markers that are not yet in `detections`, so that those of follow() are not read twice. Broken
  /// markers are included if that option is set, unless `reading` is Reading::open.
  void detect_more(const cv::Mat& grey,
                   const Lens* lens,
                   std::vector<Detection>* detections,
                   Reading reading = Reading::covered);

  /// Finds the markers of `last` again and searches only around their last places: a marker that moved by
  /// more than half of its side is lost, and new ones need detect_more(). Each square is found once, in the
  /// order of `last` (light squares after dark ones); `detections` must not be the memory of `last`. A marker
  /// that was found by its whole pattern is found by fitting the pattern again, starting from its last
  /// appearance. The full reading is repeated from time to time, and when the appearance changes. Shadows are
  /// searched for from time to time, and when the light at a side changes.
  void follow(const cv::Mat& grey,
              const Lens* lens,
              std::span<const Detection> last,
              std::vector<Detection>* detections);

  const Families& families() const { return all_families_; }

 private:
  enum class Polarity { dark_on_light, light_on_dark };
  Detector(const Families& families, const DetectorOptions& options, Polarity polarity);

  Families all_families_;
  Families families_;  // those whose squares are dark in the image
  double thinnest_border_;
  DetectorOptions options_;
  bool is_inverted_;
  // The families whose squares are light are found in the inverted image; null when there are none.
  std::unique_ptr<Detector> of_inverted_;
  cv::Mat inverted_;
  bool has_uncovered_codes_ = false;  // whether a family's codes are read with one broken side
  Threshold threshold_;
  CornerCodes corner_codes_;
  QuadFinder finder_;
  std::vector<Quad> quads_;
  struct Worker {
    EdgeRefiner refiner;
    PatternFitBuffers fit;
  };
  std::vector<Worker> workers_;  // one for each thread of the team
  SegmentFinder segment_finder_;
  Segments segments_;
  std::vector<ExclusionZone> squares_;  // places of markers that were found before segments are joined
  SegmentQuadFinder segment_quad_finder_;
  std::vector<SegmentQuad> segment_quads_;
  struct Read {
    std::size_t number = 0;  // index of its quad
    Detection detection;
    std::optional<EdgeBleed> bleed;
  };
  std::vector<Read> read_;
  std::vector<EdgeBleed> retreats_;  // edge bleed of the markers that were read

  class UnreadQuads;
  std::optional<Read> follow_by_pattern(const cv::Mat& grey, const Lens* lens, const Detection& last);
  std::optional<Read> found_again(const cv::Mat& grey, const Lens* lens, const Detection& last);
  void follow_own(const cv::Mat& grey,
                  const Lens* lens,
                  std::span<const Detection> last,
                  std::vector<Detection>* detections);
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
  std::optional<Read> read_as(const cv::Mat& grey,
                              const Quad& quad,
                              const Lens* lens,
                              Reading reading,
                              Worker& worker,
                              const Detection* last) const;
  std::optional<PatternAppearance> settle_overlapping_edges(const cv::Mat& grey,
                                                            const Lens* lens,
                                                            const Identity& identity,
                                                            Worker& worker,
                                                            const std::optional<PatternAppearance>& known,
                                                            RefinedQuad* refined) const;
};

}  // namespace limn::tracker
