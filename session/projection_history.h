#pragma once

#include <deque>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/frame.h"

namespace limn::session {

/// The images that the projectors showed recently, so that each camera frame can be compared with the images
/// that were projected when it was captured.
class ProjectionHistory {
 public:
  /// Adds the images that are shown from `shown_at` on, which must be later than all before.
  void add(const std::vector<cv::Mat>& images, Stamp shown_at);
  /// The images that were shown at a moment, one per projector; null: not known.
  const std::vector<cv::Mat>* at(Stamp moment) const;

 private:
  struct Shown {
    std::vector<cv::Mat> images;
    Stamp at;
  };
  std::deque<Shown> shown_;  // oldest first
};

}  // namespace limn::session
