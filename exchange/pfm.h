#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>

#include "core/result.h"

namespace limn::apps {

/// The bytes of a PFM (portable float map) of a CV_32FC3 image: three floats a pixel, little-endian, the
/// bottom row first.
std::string pfm_bytes(const cv::Mat& image);

/// A PFM of three channels as CV_32FC3, the top row first. Either byte order; a header without its line of
/// scale is little-endian. Error: no PFM, another number of bytes than its size says, more than
/// `most_pixels`. `where` names it in messages.
Result<cv::Mat> read_pfm(const std::string& bytes, const std::string& where, std::int64_t most_pixels);

}  // namespace limn::apps
