#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>

#include "core/result.h"

namespace limn::device {

struct JpegOptions {
  bool grey = false;   ///< brightness alone, in half the time
  cv::Size size = {};  ///< expected; another one is an error before anything is decoded. Empty: any
};

/// A camera's JPEG as 8-bit BGR, or grey where it holds one channel or `grey` asks for it. Tables that
/// webcams leave out are the standard's. A truncated or damaged picture is an error, never a half picture;
/// the message is a sentence without a place.
Result<cv::Mat> decode_jpeg(std::span<const std::uint8_t> bytes, const JpegOptions& options = {});

}  // namespace limn::device
