#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>

#include "core/result.h"

namespace limn::remote {

constexpr std::size_t k_max_tablet_image_bytes = 4 << 20;
constexpr int k_max_tablet_image_side = 4096;  ///< px, of the image that is sent
constexpr int k_drawn_side = 1280;             ///< px; larger images are reduced to it before they are used

/// Decodes an image from an untrusted sender to 8-bit BGR. The header is checked before anything is decoded:
/// at most k_max_tablet_image_bytes and k_max_tablet_image_side. An image larger than k_drawn_side is decoded
/// at a reduced size (JpegOptions). The orientation in EXIF is ignored, since browsers show frames without
/// it. Errors, in words for a guest: no JPEG, too large, damaged, or one that would take long to decode.
Result<cv::Mat> decode_tablet_image(std::span<const std::uint8_t> jpeg);

}  // namespace limn::remote
