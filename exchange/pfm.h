#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>

#include "core/result.h"

namespace limn::exchange {

/// The bytes of a PFM (portable float map) for a CV_32FC3 image: three floats for each pixel, little-endian,
/// bottom row first.
std::string pfm_bytes(const cv::Mat& image);

/// Reads a PFM of three channels as CV_32FC3, top row first. Reads either byte order; a header without its
/// scale line is little-endian. Error: not a PFM, a number of bytes that does not fit its size, or more than
/// `most_pixels` pixels. `where` names the file in messages.
Result<cv::Mat> read_pfm(const std::string& bytes, const std::string& where, std::int64_t most_pixels);

}  // namespace limn::exchange
