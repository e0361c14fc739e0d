#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/result.h"

namespace limn::device {

struct JpegOptions {
  bool grey = false;   ///< brightness alone, in half the time
  cv::Size size = {};  ///< expected; another one is an error before anything is decoded. Empty: any
  /// A larger image comes out at n/8 of its size (its own, averaged), so that no side is longer. 0: any.
  int longest_side = 0;
};

/// Width and height by the header alone, in microseconds. Errors as decode_jpeg's.
Result<cv::Size> jpeg_size(std::span<const std::uint8_t> bytes);

/// A camera's JPEG as 8-bit BGR, or grey where it holds one channel or `grey` asks for it. Tables that
/// webcams leave out are the standard's. A truncated or damaged image is an error, never a half image;
/// the message is a sentence without a place.
Result<cv::Mat> decode_jpeg(std::span<const std::uint8_t> bytes, const JpegOptions& options = {});

/// A camera's JPEG as a frame, without name and stamp: its image as decode_jpeg() gives it but that colours,
/// mostly of half the resolution, are not smoothed between their pixels, its brightness, which is what JPEG
/// itself holds, and its bytes, unless `grey` left out some of what they say. Takes four fifths of the time
/// that decode_jpeg() and a conversion to grey take. Of the options longest_side is not looked at.
Result<Frame> decode_frame(std::string jpeg, const JpegOptions& options = {});

/// 8-bit grey or BGR as JPEG, colour at half the resolution (4:2:0). `quality` is 1 … 100.
std::vector<std::uint8_t> encode_jpeg(const cv::Mat& image, int quality);

}  // namespace limn::device
