#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::tracker {

/// An ARToolKit template that was trained from an image: the inside of a black frame. It holds size x size
/// values for each of B, G and R, row by row. 0 is the frame's black and 255 the paper beside it, so that the
/// light in the image does not influence the template.
struct TrainedTemplate {
  static constexpr int k_size = 16;  ///< ARToolKit's default, AR_PATT_SIZE1
  std::array<std::vector<std::uint8_t>, 3> bgr;
  std::array<Eigen::Vector2d, 4> corners_px;  ///< corners of the frame, clockwise from its top left
  double side_px = 0;                         ///< square root of the frame's area
};

/// Finds the only frame in the image (8-bit grey or BGR, as from read_image). Its corner nearest to the
/// image's top left becomes the marker's top left, so hold the marker upright. Frames inside the frame belong
/// to its pattern. Errors: no such frame, several (with their places), one that is too small for its values,
/// one whose inside is uniform. `pattern_ratio` is the inside's width as share of the frame's
/// (is_pattern_ratio()).
Result<TrainedTemplate> train_template(const cv::Mat& image, double pattern_ratio = 0.5);

/// The text of a template file as ARToolKit's mk_patt writes it: 4 blocks, each the previous one turned
/// anticlockwise by 90 degrees, of 3 colours of size lines of size numbers.
std::string template_text(const TrainedTemplate& trained);

}  // namespace limn::tracker
