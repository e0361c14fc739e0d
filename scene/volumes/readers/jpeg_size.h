#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

namespace limn::scene {

/// Columns and rows of a grey JPEG or JPEG-LS image by its first frame header (ITU-T T.81, B.2.2; T.87,
/// C.2.2), which must lie within `head`. Nullopt: another format, colours, or damaged.
std::optional<std::array<long, 2>> jpeg_size(std::span<const std::uint8_t> head);

/// Bytes of an image that are searched for its frame header; embedded profiles lie before it.
constexpr std::size_t k_longest_jpeg_head = std::size_t{1} << 20;

}  // namespace limn::scene
