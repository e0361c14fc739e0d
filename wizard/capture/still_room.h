#pragma once

#include <opencv2/core/mat.hpp>

#include "core/frame.h"

namespace limn::apps {

/// Tells when nothing has moved in one camera's frames for a while: people who carry a thing about have put
/// it down and stepped back.
class StillRoom {
 public:
  static constexpr double k_rest_s = 8;

  /// The next frame, 8-bit grey or BGR; stamps must not go back. True: nothing moved for k_rest_s.
  bool take(const cv::Mat& image, Stamp at);

 private:
  cv::Mat still_;  // small and grey; since `since_`
  Stamp since_;
};

}  // namespace limn::apps
