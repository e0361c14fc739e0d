#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>

#include "core/result.h"

namespace limn::remote {

constexpr std::size_t k_most_guest_bytes = 4 << 20;
constexpr int k_most_guest_side = 4096;  ///< px, of what is sent
constexpr int k_drawn_side = 1280;       ///< px: larger images are looked at and drawn smaller

/// An image that a stranger sent, as 8-bit BGR. The header is judged before anything is decoded: at most
/// k_most_guest_bytes and k_most_guest_side. Larger than k_drawn_side it comes out smaller (JpegOptions). How
/// a camera was turned (EXIF) is ignored, as the browser shows frames as they are. Errors, in a guest's
/// words: no JPEG, too large, damaged, or one that would take long to decode.
Result<cv::Mat> decode_tablet_image(std::span<const std::uint8_t> jpeg);

}  // namespace limn::remote
