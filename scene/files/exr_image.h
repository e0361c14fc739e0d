#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>

#include "core/result.h"

namespace limn::scene {

/// The largest image of linear light.
inline constexpr int k_most_hdr_width = 16384, k_most_hdr_height = 8192;

/// Error: an image of this size is larger. `name` says where it is.
inline Status check_hdr_size(const std::string& name, long width, long height) {
  if (width >= 1 && height >= 1 && width <= k_most_hdr_width && height <= k_most_hdr_height) return {};
  return error("{}: expected an image of at most {} x {} pixels, found {} x {}.", name, k_most_hdr_width,
               k_most_hdr_height, width, height);
}

/// Reads the bytes of an OpenEXR file: R, G and B, or luminance and chroma, as CV_32FC3 (BGR). `name` says in
/// messages where the image is. Errors: no such channels, a damaged file, one that is too large; the shared
/// library with OpenEXR (scene/files/exr/) is not there.
Result<cv::Mat> decode_exr(std::string_view bytes, const std::string& name);

/// The bytes of an OpenEXR file for a CV_32FC3 image: channels R, G and B (in the order of the image's),
/// 32-bit floats, zip compressed, top row first. `comment` is stored in the file and says what the channels
/// mean. Error: the shared library with OpenEXR is not there.
Result<std::string> encode_exr(const cv::Mat& image, const std::string& comment);

}  // namespace limn::scene
