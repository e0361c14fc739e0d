#pragma once

// Compares what the renderer draws with the ray tracer's images, by the limits of `limn check`.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "core/photometric_response.h"
#include "sim/reference_renderer.h"

namespace limn::projector {

/// Whether a picture agrees with the judge's where that covers whole pixels: the largest differences of the
/// channels have a mean of at most 1 level, and at most 0.5 % of them are over 4 levels. `gamma`: of the
/// picture's encoding; 0: sRGB. `least`: pixels that must be covered.
inline testing::AssertionResult agree(const cv::Mat& drawn,
                                      const sim::PartImage& judged,
                                      double gamma,
                                      int least) {
  int count = 0, far_off = 0;
  double sum = 0;
  for (int row = 0; row < drawn.rows; ++row)
    for (int column = 0; column < drawn.cols; ++column) {
      if (judged.cover.at<float>(row, column) < 1) continue;
      double worst = 0;
      for (int c = 0; c < 3; ++c) {
        const auto light =
            std::clamp(static_cast<double>(judged.light.at<cv::Vec3f>(row, column)[c]), 0.0, 1.0);
        const double wanted = 255 * (gamma > 0 ? std::pow(light, 1 / gamma) : srgb_from_linear(light));
        worst = std::max(worst, std::abs(drawn.at<cv::Vec3b>(row, column)[c] - wanted));
      }
      ++count;
      sum += worst;
      far_off += worst > 4;
    }
  const double mean = count > 0 ? sum / count : 255, share = count > 0 ? 1.0 * far_off / count : 1;
  const bool is_good = count >= least && mean <= 1 && share <= 0.005;
  return (is_good ? testing::AssertionSuccess() : testing::AssertionFailure())
         << count << " pixels, mean " << mean << " levels, over 4 levels " << 100 * share << " %";
}

}  // namespace limn::projector
