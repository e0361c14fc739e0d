#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string_view>

#include "core/result.h"

namespace limn::scene {

/// Largest value of a pixel that is kept; brighter ones, such as the sun, are cut off there.
inline constexpr float k_most_hdr_light = 60000;

/// Reads an image of linear light, CV_32FC3 (BGR), 0 … k_most_hdr_light: Radiance (.hdr, .pic: RGBE, packed
/// or not) or OpenEXR (.exr: R, G and B, or luminance and chroma). Error: another format, a damaged file,
/// more than 16384 x 8192 pixels, values that are not finite.
Result<cv::Mat> read_hdr_image(const std::filesystem::path& path);
/// As read_hdr_image, from the bytes of a file. `name` says in messages where the image is.
Result<cv::Mat> decode_hdr_image(std::string_view bytes, const std::string& name);

}  // namespace limn::scene
