#pragma once

#include <deque>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/frame.h"

namespace limn::apps {

/// What the projectors showed lately, so that each frame can be compared with the images that lit it.
class ProjectionHistory {
 public:
  /// From `shown_at` on; later than all before.
  void add(const std::vector<cv::Mat>& images, Stamp shown_at);
  /// On the prototype at a moment, one a projector; null when that is not known.
  const std::vector<cv::Mat>* at(Stamp moment) const;

 private:
  struct Shown {
    std::vector<cv::Mat> images;
    Stamp at;
  };
  std::deque<Shown> shown_;  // oldest first
};

}  // namespace limn::apps
