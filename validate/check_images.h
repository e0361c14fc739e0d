#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace limn::validate {

constexpr double k_dark = 0.5 / 255;       // share of full light; darker pixels count as unlit
constexpr double k_projector_gamma = 2.2;  // the renderer encodes for it if no response was measured
constexpr double k_seam_blur_px =
    1;  // 8-bit levels average out; a viewer at this resolution sees no finer detail

/// Linear light (CV_32FC3) as 8-bit sRGB.
cv::Mat srgb_image(const cv::Mat& light);

/// A projector's 8-bit image as linear light (CV_32F).
cv::Mat linear_light(const cv::Mat& image);

/// A difference (8-bit, or linear light) as an 8-bit image for people, 32 times as bright: 4/255 becomes 128.
cv::Mat amplified(const cv::Mat& difference);

/// A grey image as BGR.
cv::Mat bgr_image(const cv::Mat& grey);

/// Red where the labels differ, over the dimmed `found` labels.
cv::Mat label_difference(const cv::Mat& found, const cv::Mat& truth);

/// For each pixel the index of the part in front (CV_16S, -1: none) as a grey level.
cv::Mat owner_shades(const cv::Mat& front);

/// The share of the pixels of `domain` that are in `mask`.
double share_within(const cv::Mat& mask, const cv::Mat& domain);

/// Mask of the pixels in which a channel exceeds the threshold.
cv::Mat any_channel_over(const cv::Mat& light, double threshold);

/// The errors of an image: their mean over the `shown` pixels; the share of all pixels in which a channel is
/// more than 4 levels off; the same share of the `shown` pixels away from edges.
struct LevelErrors {
  double mean = 0;
  double over = 0;
  double inner_over = 0;
};

/// `off` and `expected` are in levels, CV_32FC3.
LevelErrors level_errors(const cv::Mat& off, const cv::Mat& expected, const cv::Mat& shown);

/// The errors as a caption.
std::string level_errors_caption(const LevelErrors& errors, const cv::Mat& shown);

/// A square kernel of this side for cv::erode and cv::dilate.
cv::Mat square_kernel(int side);

/// By how much the luminance of `less` is below that of `more`, as a share of the latter; both are 8-bit
/// sRGB.
cv::Mat missing_luminance(const cv::Mat& more, const cv::Mat& less);

/// The 95 % quantile of the values (CV_32F) at the pixels of `where`; 0 without such pixels.
double p95_within(const cv::Mat& values, const cv::Mat& where);

}  // namespace limn::validate
