#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::tracker {

/// What an image says about one ARToolKit template: the inside of a black frame whose border is a quarter of
/// its side, size x size values, B, G and R, each size * size, row by row; 0 is the frame's black, 255 the
/// paper beside it, so that the light of the image does not go into the template.
struct TrainedTemplate {
  static constexpr int k_size = 16;  ///< ARToolKit's default, AR_PATT_SIZE1
  std::array<std::vector<std::uint8_t>, 3> bgr;
  std::array<Eigen::Vector2d, 4> corners_px;  ///< of the frame, from its top left, clockwise
  double side_px = 0;                         ///< square root of its area
};

/// Finds the one frame of the image (8-bit grey or BGR, as read_image gives it), whose corner nearest to
/// the image's top left becomes the marker's own: hold the marker upright. Frames inside the frame belong
/// to its image. Errors: no such frame, several (their places), one too small for its values, one whose
/// inside is even.
Result<TrainedTemplate> train_template(const cv::Mat& image);

/// As ARToolKit's mk_patt writes it: 4 blocks, each the block before turned anticlockwise by 90 degrees, of 3
/// colours of size lines of size numbers.
std::string template_text(const TrainedTemplate& trained);

}  // namespace limn::tracker
