#include "calib/code/white_black.h"

#include <algorithm>

#include "core/image_io.h"
#include "core/median.h"

namespace limn::calib {
namespace {

// White and black of one pixel from its pairs.
std::pair<double, double> from_pairs(const std::vector<uchar>& values) {
  double sum = 0;
  std::vector<int> differences;
  for (size_t i = 0; i + 1 < values.size(); i += 2) {
    sum += values[i] + values[i + 1];
    differences.push_back(std::abs(values[i] - values[i + 1]));
  }
  const double mean = sum / static_cast<double>(differences.size());
  const double range = quantile(std::move(differences), 0.75);
  return {(mean + range) / 2, (mean - range) / 2};
}

// White and black of one pixel from its bright and its dark values.
std::pair<double, double> from_values(const std::vector<uchar>& values) {
  constexpr double k_clear = 0.25;  // share of the range: distance from the middle
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  const double middle = (*low + *high) / 2.0, margin = k_clear * (*high - *low);
  double bright = 0, dark = 0;
  int brights = 0, darks = 0;
  for (const uchar value : values) {
    if (value >= middle + margin) bright += value, ++brights;
    if (value <= middle - margin) dark += value, ++darks;
  }
  return {bright / brights, dark / darks};
}

}  // namespace

Result<WhiteBlack> white_black_of(const std::vector<std::filesystem::path>& images, bool inverses) {
  std::vector<cv::Mat> all;
  for (const auto& path : images) {
    LIMN_TRY(cv::Mat image, read_grey_image(path));
    if (!all.empty() && image.size() != all[0].size())
      return error("{}: expected an image of {}x{} pixels, as the others of its series, found {}x{}.",
                   path.string(), all[0].cols, all[0].rows, image.cols, image.rows);
    all.push_back(std::move(image));
  }
  WhiteBlack made{cv::Mat(all[0].size(), CV_8U), cv::Mat(all[0].size(), CV_8U)};
  std::vector<uchar> values(all.size());
  for (int y = 0; y < made.white.rows; ++y) {
    for (int x = 0; x < made.white.cols; ++x) {
      for (size_t i = 0; i < all.size(); ++i) values[i] = all[i].at<uchar>(y, x);
      const auto [white, black] = inverses ? from_pairs(values) : from_values(values);
      made.white.at<uchar>(y, x) = cv::saturate_cast<uchar>(white);
      made.black.at<uchar>(y, x) = cv::saturate_cast<uchar>(black);
    }
  }
  return made;
}

}  // namespace limn::calib
