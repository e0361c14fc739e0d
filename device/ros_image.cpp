#include "device/ros_image.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>
#include <string>

#include "core/image_io.h"
#include "device/jpeg.h"

namespace limn::device {
namespace {

constexpr int k_as_it_is = -1;  // no conversion of colours

// What the bytes of a pixel mean.
struct RosEncoding {
  std::string_view name;
  int channels = 1, sample_bytes = 1;
  int to_bgr = k_as_it_is;  // the conversion of OpenCV
  int luma = -1;            // the channel that is the luma; -1: none
  int unit_px = 1;          // width and height are multiples of this
};

// ROS 2 names a Bayer pattern by its first two pixels in two rows, OpenCV by the second row's second and
// third.
constexpr std::array k_ros_encodings = {
    RosEncoding{"mono8"},
    RosEncoding{"8UC1"},
    RosEncoding{"mono16", 1, 2},
    RosEncoding{"16UC1", 1, 2},
    RosEncoding{"bgr8", 3},
    RosEncoding{"8UC3", 3},
    RosEncoding{"bgr16", 3, 2},
    RosEncoding{"rgb8", 3, 1, cv::COLOR_RGB2BGR},
    RosEncoding{"rgb16", 3, 2, cv::COLOR_RGB2BGR},
    RosEncoding{"bgra8", 4, 1, cv::COLOR_BGRA2BGR},
    RosEncoding{"8UC4", 4, 1, cv::COLOR_BGRA2BGR},
    RosEncoding{"bgra16", 4, 2, cv::COLOR_BGRA2BGR},
    RosEncoding{"rgba8", 4, 1, cv::COLOR_RGBA2BGR},
    RosEncoding{"rgba16", 4, 2, cv::COLOR_RGBA2BGR},
    RosEncoding{"bayer_rggb8", 1, 1, cv::COLOR_BayerBG2BGR, -1, 2},
    RosEncoding{"bayer_rggb16", 1, 2, cv::COLOR_BayerBG2BGR, -1, 2},
    RosEncoding{"bayer_bggr8", 1, 1, cv::COLOR_BayerRG2BGR, -1, 2},
    RosEncoding{"bayer_bggr16", 1, 2, cv::COLOR_BayerRG2BGR, -1, 2},
    RosEncoding{"bayer_gbrg8", 1, 1, cv::COLOR_BayerGR2BGR, -1, 2},
    RosEncoding{"bayer_gbrg16", 1, 2, cv::COLOR_BayerGR2BGR, -1, 2},
    RosEncoding{"bayer_grbg8", 1, 1, cv::COLOR_BayerGB2BGR, -1, 2},
    RosEncoding{"bayer_grbg16", 1, 2, cv::COLOR_BayerGB2BGR, -1, 2},
    RosEncoding{"uyvy", 2, 1, cv::COLOR_YUV2BGR_UYVY, 1, 2},
    RosEncoding{"yuv422", 2, 1, cv::COLOR_YUV2BGR_UYVY, 1, 2},
    RosEncoding{"yuyv", 2, 1, cv::COLOR_YUV2BGR_YUYV, 0, 2},
    RosEncoding{"yuv422_yuy2", 2, 1, cv::COLOR_YUV2BGR_YUYV, 0, 2},
};

// Text of another machine as it may stand in a message to people.
std::string plain(std::string_view text) {
  constexpr std::size_t k_longest = 40;
  std::string out(text.substr(0, k_longest));
  std::ranges::replace_if(
      out, [](char c) { return c < ' ' || c > '~'; }, '?');
  return out;
}

std::string all_ros_encodings() {
  std::string names;
  for (const RosEncoding& each : k_ros_encodings)
    names += (names.empty() ? "" : ", ") + std::string(each.name);
  return names;
}

Result<RosEncoding> encoding_of(std::string_view name) {
  const auto* const found = std::ranges::find(k_ros_encodings, name, &RosEncoding::name);
  if (found != k_ros_encodings.end()) return *found;
  return error("encoding: expected one of {}, found '{}'. Set one of them at the camera's driver.",
               all_ros_encodings(), plain(name));
}

// Everything that is needed before a byte of the image may be read.
Status check_layout(const RosImage& image, const RosEncoding& encoding) {
  const std::uint64_t width = image.width, height = image.height,
                      unit = static_cast<std::uint64_t>(encoding.unit_px);
  if (width < unit || height < unit || width > k_max_image_side || height > k_max_image_side ||
      width * height > k_max_image_pixels)
    return error(
        "expected an image of {} to {} pixels on each side and at most {} in all, found {}x{}. Check the "
        "camera's driver.",
        unit, k_max_image_side, k_max_image_pixels, width, height);
  if (width % unit != 0 || (encoding.luma < 0 && height % unit != 0))
    return error(
        "expected an even width and height with the encoding {}, found {}x{}. Set another size at the "
        "camera's driver.",
        encoding.name, width, height);
  const std::uint64_t row = width * static_cast<std::uint64_t>(encoding.channels * encoding.sample_bytes);
  if (image.step < row)
    return error(
        "step: expected at least {} bytes ({} pixels of {}), found {}. The camera's driver fills the "
        "message wrongly; use another version.",
        row, width, encoding.name, image.step);
  if (image.bytes.size() < image.step * height)
    return error(
        "data: expected {} bytes ({} rows of step {}), found {}. The camera's driver fills the message "
        "wrongly, or the image was cut; use another version.",
        image.step * height, height, image.step, image.bytes.size());
  return {};
}

// The image's samples in place, or the high bytes of 16-bit ones. Valid as long as the message.
cv::Mat samples_of(const RosImage& image, const RosEncoding& encoding) {
  const int width = static_cast<int>(image.width), height = static_cast<int>(image.height);
  // OpenCV has no view of constant memory; it is only read.
  auto* const at = const_cast<std::uint8_t*>(image.bytes.data());
  if (encoding.sample_bytes == 1) return {height, width, CV_8UC(encoding.channels), at, image.step};
  cv::Mat high(height, width, CV_8UC(encoding.channels));
  const int count = width * encoding.channels;
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* in =
        at + std::size_t{image.step} * static_cast<std::size_t>(y) + (image.is_bigendian ? 0 : 1);
    std::uint8_t* const out = high.ptr(y);
    for (int i = 0; i < count; ++i) out[i] = in[2 * i];
  }
  return high;
}

Result<Frame> raw_frame(const RosImage& image, bool grey) {
  LIMN_TRY(const RosEncoding encoding, encoding_of(image.encoding));
  LIMN_TRY_STATUS(check_layout(image, encoding));
  const cv::Mat samples = samples_of(image, encoding);
  Frame frame;
  if (grey && encoding.luma >= 0) {
    cv::extractChannel(samples, frame.image, encoding.luma);
  } else if (encoding.to_bgr == k_as_it_is) {
    frame.image = samples.clone();
  } else {
    cv::cvtColor(samples, frame.image, encoding.to_bgr);
  }
  if (grey) frame.image = to_grey(frame.image);
  return frame;
}

Result<Frame> compressed_frame(const RosImage& image, bool grey) {
  constexpr std::string_view k_jpeg = "\xff\xd8", k_png = "\x89PNG";
  const std::string_view bytes(reinterpret_cast<const char*>(image.bytes.data()), image.bytes.size());
  if (bytes.starts_with(k_jpeg)) {
    auto frame = device::decode_frame(std::string(bytes), {.grey = grey});
    if (!frame) return error("{} Check the camera and the network.", frame.message());
    return frame;
  }
  if (!bytes.starts_with(k_png))
    return error(
        "expected a JPEG or a PNG, found {} bytes of the format '{}'. Set jpeg or png at the camera's "
        "driver (image_transport's format), and use no topic of depth.",
        bytes.size(), plain(image.encoding));
  Frame frame;
  LIMN_TRY(frame.image, decode_image(bytes, "PNG", {.grey = grey, .alpha = Alpha::ignored}));
  return frame;
}

}  // namespace

Result<Frame> frame_of_ros(const RosImage& image, bool grey) {
  return image.is_compressed ? compressed_frame(image, grey) : raw_frame(image, grey);
}

}  // namespace limn::device
