#include "validate/check_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/photometric_response.h"

namespace limn::validate {
namespace {

constexpr double k_over = 4;  // levels by which a pixel may be off
constexpr double k_edge_levels =
    8;  // levels between neighbours; above it, the sampling of a pixel matters more than its colour
constexpr double k_difference_gain = 32;  // 4/255 becomes 128

// Mask of the pixels of an image (levels, CV_32FC3) whose neighbourhood is nearly even.
cv::Mat nearly_even(const cv::Mat& image) {
  const cv::Mat around = square_kernel(3);
  cv::Mat highest, lowest;
  cv::dilate(image, highest, around);
  cv::erode(image, lowest, around);
  return ~any_channel_over(highest - lowest, k_edge_levels);
}

}  // namespace

cv::Mat srgb_image(const cv::Mat& light) {
  cv::Mat levels(light.size(), CV_8UC3);
  for (int row = 0; row < light.rows; ++row)
    for (int column = 0; column < light.cols; ++column)
      for (int c = 0; c < 3; ++c)
        levels.at<cv::Vec3b>(row, column)[c] = cv::saturate_cast<std::uint8_t>(
            255 * srgb_from_linear(std::clamp(double(light.at<cv::Vec3f>(row, column)[c]), 0.0, 1.0)));
  return levels;
}

cv::Mat linear_light(const cv::Mat& image) {
  cv::Mat table(1, 256, CV_32F), light;
  for (int v = 0; v < 256; ++v)
    table.at<float>(v) = static_cast<float>(std::pow(v / 255.0, k_projector_gamma));
  cv::LUT(image, table, light);
  return light;
}

cv::Mat amplified(const cv::Mat& difference) {
  cv::Mat levels;
  difference.convertTo(levels, CV_8U,
                       difference.depth() == CV_8U ? k_difference_gain : 255 * k_difference_gain);
  return levels;
}

cv::Mat bgr_image(const cv::Mat& grey) {
  cv::Mat colour;
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  return colour;
}

cv::Mat label_difference(const cv::Mat& found, const cv::Mat& truth) {
  cv::Mat image = bgr_image(found / 3);
  image.setTo(cv::Scalar(60, 80, 255), found != truth);
  return image;
}

cv::Mat owner_shades(const cv::Mat& front) {
  cv::Mat grey;
  front.convertTo(grey, CV_8U, 60, 75);
  grey.setTo(0, front < 0);
  return grey;
}

double share_within(const cv::Mat& mask, const cv::Mat& domain) {
  return static_cast<double>(cv::countNonZero(mask & domain)) / std::max(1, cv::countNonZero(domain));
}

cv::Mat any_channel_over(const cv::Mat& light, double threshold) {
  std::vector<cv::Mat> channels;
  cv::split(light, channels);
  return (channels[0] > threshold) | (channels[1] > threshold) | (channels[2] > threshold);
}

cv::Mat square_kernel(int side) { return cv::getStructuringElement(cv::MORPH_RECT, {side, side}); }

LevelErrors level_errors(const cv::Mat& off, const cv::Mat& expected, const cv::Mat& shown) {
  const cv::Mat wrong = any_channel_over(off, k_over);
  const cv::Scalar mean = cv::mean(off, shown);
  return {(mean[0] + mean[1] + mean[2]) / 3,
          static_cast<double>(cv::countNonZero(wrong)) / static_cast<double>(off.total()),
          share_within(wrong, shown & nearly_even(expected))};
}

std::string level_errors_caption(const LevelErrors& errors, const cv::Mat& shown) {
  return fmt::format(
      "{} pixels; mean {:.3f}/255; over 4/255: {:.3f} % of the image, {:.3f} % of the parts away from edges. "
      "Difference: amplified 32 times.",
      cv::countNonZero(shown), errors.mean, 100 * errors.over, 100 * errors.inner_over);
}

cv::Mat missing_luminance(const cv::Mat& more, const cv::Mat& less) {
  const auto luminance = [](const cv::Mat& image) {
    cv::Mat table(1, 256, CV_32F), light;
    for (int v = 0; v < 256; ++v) table.at<float>(v) = static_cast<float>(linear_from_srgb(v / 255.0));
    cv::LUT(image, table, light);
    cv::transform(light, light, cv::Matx13f(0.0722F, 0.7152F, 0.2126F));
    cv::GaussianBlur(light, light, {0, 0}, k_seam_blur_px);
    return light;
  };
  const cv::Mat whole = luminance(more);
  return cv::max((whole - luminance(less)) / cv::max(whole, k_dark), 0);
}

double p95_within(const cv::Mat& values, const cv::Mat& where) {
  std::vector<float> chosen;
  for (int row = 0; row < values.rows; ++row)
    for (int column = 0; column < values.cols; ++column)
      if (where.at<std::uint8_t>(row, column)) chosen.push_back(values.at<float>(row, column));
  if (chosen.empty()) return 0;
  const auto at = static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(chosen.size() - 1));
  std::nth_element(chosen.begin(), chosen.begin() + at, chosen.end());
  return chosen[static_cast<std::size_t>(at)];
}

}  // namespace limn::validate
