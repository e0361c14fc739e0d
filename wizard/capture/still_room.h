#pragma once

#include <opencv2/core/mat.hpp>

#include "core/frame.h"

namespace limn::wizard {

/// Detects that nothing has moved in one camera's frames for a while: people have put the prototype down and
/// stepped back.
class StillRoom {
 public:
  static constexpr double k_rest_s = 8;

  /// Adds the next frame, 8-bit grey or BGR; stamps must not decrease. True: nothing has moved for k_rest_s.
  bool add_image(const cv::Mat& image, Stamp at);

 private:
  cv::Mat still_;  // small grey image at `since_`
  Stamp since_;
};

}  // namespace limn::wizard
