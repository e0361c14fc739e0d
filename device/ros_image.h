#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "core/frame.h"
#include "core/result.h"

namespace limn::device {

/// An image as a message of ROS 2 states it, unchecked: sensor_msgs/Image or sensor_msgs/CompressedImage. It
/// borrows the message's memory.
struct RosImage {
  bool is_compressed = false;
  std::string_view encoding = {};  ///< "rgb8"; a CompressedImage's `format`, which says little.
  std::uint32_t width = 0, height = 0;
  std::uint32_t step = 0;     ///< Bytes from one row to the next.
  bool is_bigendian = false;  ///< Order of the bytes of 16-bit samples.
  std::span<const std::uint8_t> bytes = {};
};

/// The image as a frame without name and stamp: 8-bit grey or BGR; grey only if `grey`. Encodings: mono, rgb,
/// bgr, rgba, bgra and the four Bayer patterns, each with 8 or 16 bits (of 16 the highest eight are read, as
/// ROS 2 counts 65535 as white); 8UC1, 8UC3 and 8UC4 (grey, BGR, BGRA) and 16UC1; uyvy (also called yuv422)
/// and yuyv (yuv422_yuy2). A compressed image is a JPEG or a PNG by its first bytes. Error: another encoding,
/// a size that cannot be, a step that is shorter than a row, missing bytes, a damaged JPEG or PNG.
Result<Frame> frame_of_ros(const RosImage& image, bool grey = false);

}  // namespace limn::device
