#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "core/result.h"

namespace limn::nodes {

/// Largest number of pixels of a packed image.
inline constexpr long k_most_packed_pixels = 1L << 22;

/// An 8-bit image of 1, 3 or 4 channels without loss, in few bytes where it has even areas, such as maps of
/// shadows and signs. Each pixel becomes its exclusive or with the pixel above it. The pixels of all rows
/// then follow each other in groups: a number n (LEB128); if it is odd, one pixel that stands for n / 2 equal
/// ones; else n / 2 pixels. Takes about 1 ns for each byte of the image.
std::vector<std::uint8_t> packed(const cv::Mat& image);

/// The image again. Error: the bytes do not describe an image of this size, or it is larger than
/// k_most_packed_pixels. An empty size gives an empty image.
Result<cv::Mat> unpacked(std::span<const std::uint8_t> bytes, const cv::Size& size, int channels);

}  // namespace limn::nodes
