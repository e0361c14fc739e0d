#pragma once

// Images: views on memory of the caller, and images with memory of their own.
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "limn/export.h"

namespace limn::LIMN_VERSIONED {

enum class PixelFormat { grey, rgb, bgr };

/// An image in the caller's memory, 8 bits a channel, first row first. Nothing is copied or kept after the
/// call.
struct ImageView {
  const std::uint8_t* data = nullptr;
  int width = 0, height = 0;
  std::ptrdiff_t stride = 0;  ///< bytes from a row to the next; at least width times channels
  PixelFormat format = PixelFormat::grey;
};

/// The same, to write into.
struct MutableImageView {
  std::uint8_t* data = nullptr;
  int width = 0, height = 0;
  std::ptrdiff_t stride = 0;
  PixelFormat format = PixelFormat::rgb;

  operator ImageView() const { return {data, width, height, stride, format}; }
};

/// An image with its own memory, without gaps between its rows.
struct Image {
  std::vector<std::uint8_t> pixels = {};
  int width = 0, height = 0;
  PixelFormat format = PixelFormat::rgb;

  int channels() const { return format == PixelFormat::grey ? 1 : 3; }
  std::ptrdiff_t stride() const { return static_cast<std::ptrdiff_t>(width) * channels(); }
  ImageView view() const { return {pixels.data(), width, height, stride(), format}; }
  MutableImageView view() { return {pixels.data(), width, height, stride(), format}; }
};

/// Reads PNG, JPEG, PBM, PGM, PPM, BMP, TIFF, WebP or TGA; `format` is the result's. Transparent parts are
/// shown on white. Error: no such file, damaged, of another format, larger than 32767 pixels a side.
LIMN_API Image read_image(const std::filesystem::path& path, PixelFormat format = PixelFormat::rgb);

/// Writes a PNG. When writing fails, `path` keeps its old content.
LIMN_API void write_png(const std::filesystem::path& path, const ImageView& image);

}  // namespace limn::LIMN_VERSIONED
