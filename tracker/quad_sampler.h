#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>

namespace limn::tracker {

/// Samples grey levels at many places of the unit square that a quadrilateral shows. Outside the image the
/// nearest edge pixel counts. Places without a defined pixel (the corners are no quadrilateral) read an
/// arbitrary pixel.
class QuadSampler {
 public:
  /// Largest number of places in one call.
  static constexpr std::size_t k_most = 608;

  /// `corners_px` are the pixels of (0, 0), (1, 0), (1, 1) and (0, 1). `grey`, 8-bit and not empty, must
  /// outlive this object. `beyond`: how far outside of the unit square there are places to sample.
  QuadSampler(const cv::Mat& grey, const std::array<Eigen::Vector2d, 4>& corners_px, double beyond = 0);

  /// Levels of the nearest pixels.
  void nearest(std::span<const float> x, std::span<const float> y, std::uint8_t* levels) const;

  /// Levels by bilinear interpolation.
  void between(std::span<const float> x, std::span<const float> y, float* levels) const;

  /// Image and quadrilateral, relative to a pixel near the quadrilateral's upper left.
  struct View {
    std::array<float, 8> homography;  ///< row by row, the last entry 1
    float high_x, high_y;             ///< last pixel of the image
    std::int32_t last_x, last_y;      ///< last pixel with a right neighbour and one below
    std::int32_t stride;
  };

 private:
  View view_;
  const std::uint8_t* origin_;
  int right_, below_;  // offset from a pixel to its neighbours; 0 where there is none
};

}  // namespace limn::tracker
