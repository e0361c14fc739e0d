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
  bool grey = false;   ///< Decodes a grey image only, in half the time.
  cv::Size size = {};  ///< Expected size; another one is an error before decoding. Empty: any size.
  /// A larger image is reduced to n/8 of its size by averaging, so that no side is longer. 0: no limit.
  int longest_side = 0;
};

/// Width and height from the header, which takes only microseconds. Errors are those of decode_jpeg().
Result<cv::Size> jpeg_size(std::span<const std::uint8_t> bytes);

/// Decodes a camera's JPEG to 8-bit BGR, or to grey if it has one channel or `grey` is set. If a webcam
/// leaves out the Huffman tables, the standard's are used. A truncated or damaged image is an error; the
/// message does not name the camera.
Result<cv::Mat> decode_jpeg(std::span<const std::uint8_t> bytes, const JpegOptions& options = {});

/// Decodes a camera's JPEG to a frame without name and stamp. The frame has the image as from decode_jpeg(),
/// except that colours (mostly stored at half the resolution) are not interpolated; the luma channel from the
/// JPEG as `grey`; and, unless `grey` is set, the JPEG's bytes. This takes four fifths of the time of
/// decode_jpeg() and a conversion to grey. The option longest_side is ignored.
Result<Frame> decode_frame(std::string jpeg, const JpegOptions& options = {});

/// Encodes an 8-bit grey or BGR image as JPEG, colours at half the resolution (4:2:0). `quality` is 1 … 100.
std::vector<std::uint8_t> encode_jpeg(const cv::Mat& image, int quality);

}  // namespace limn::device
