#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <utility>
#include <vector>

#include "core/gesture.h"
#include "core/lens.h"
#include "tracker/balls/ball_finder.h"
#include "tracker/cameras/camera_detections.h"
#include "tracker/detector.h"
#include "tracker/gesture.h"

namespace limn::tracker {

/// What is searched for in the images of a camera.
struct CameraDetectorSetup {
  Families families;
  std::vector<MarkerName> used = {};  ///< markers of bodies and controls; none: no markers are searched for
  std::vector<std::pair<MarkerName, Gesture>> controls = {};
  bool finds_balls = false;
  /// In every N-th image the whole image is searched for markers; a third as often while all used markers are
  /// seen. In between, markers are followed near their predicted positions only.
  int full_scan_every = 3;
};

/// One camera's images -> detections: markers, balls, and gestures of control markers. Its only clock is the
/// frames' stamps, so the same frames give the same detections, on any machine.
class CameraDetector {
 public:
  /// `encoding`: DetectorOptions::encoding. `run`: CameraDetections::run.
  CameraDetector(const CameraDetectorSetup& setup,
                 const Lens& lens,
                 Encoding encoding,
                 std::uint64_t run = 0);

  /// Whether another camera sees a marker now; empty: there is none.
  using SeenElsewhere = std::function<bool(const MarkerName&)>;

  /// What the next image shows, valid until the next call. Images must come in the order of their stamps.
  const CameraDetections& detect(const Frame& frame, const SeenElsewhere& seen_elsewhere = {});

 private:
  void find_markers(Stamp captured_at, const SeenElsewhere& seen_elsewhere);
  bool all_are_seen(const SeenElsewhere& seen_elsewhere) const;

  Lens lens_;
  std::vector<MarkerName> used_;
  bool finds_balls_;
  int full_scan_every_;
  Detector detector_;
  BallFinder ball_finder_;
  std::vector<GestureReader> gestures_;  // one per control
  int until_search_ = 0, searches_ = 0;
  std::vector<Detection> before_;  // detections in the image before the newest
  Stamp seen_at_;                  // stamp of the newest image
  double seconds_ = 0;             // time between the last two images
  cv::Mat grey_;                   // the newest image
  CameraDetections newest_;
};

}  // namespace limn::tracker
