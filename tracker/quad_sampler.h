#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>

namespace limn::tracker {

/// Grey levels at places of the unit square that a quadrilateral shows, many at once. Beside the image its
/// edge goes on. Places whose pixel cannot be said (the corners are no quadrilateral) read some pixel.
class QuadSampler {
 public:
  /// So many places at most in one call.
  static constexpr std::size_t k_most = 512;

  /// `corners_px` are those of (0, 0), (1, 0), (1, 1) and (0, 1); `grey`, 8-bit and not empty, must outlive
  /// this.
  QuadSampler(const cv::Mat& grey, const std::array<Eigen::Vector2d, 4>& corners_px);

  /// Of the nearest pixels.
  void nearest(std::span<const float> x, std::span<const float> y, std::uint8_t* levels) const;

  /// Bilinear.
  void between(std::span<const float> x, std::span<const float> y, float* levels) const;

  /// What is needed of image and quadrilateral, about a pixel near its upper left.
  struct View {
    std::array<float, 8> homography;  ///< row by row, the last entry 1
    float high_x, high_y;             ///< the image's last pixel
    std::int32_t last_x, last_y;      ///< the last one that has a neighbour on its right, below
    std::int32_t stride;
  };

 private:
  View view_;
  const std::uint8_t* origin_;
  int right_, below_;  // from a pixel to its neighbours; 0 where there is none
};

}  // namespace limn::tracker
