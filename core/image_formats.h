#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>

#include "core/result.h"

namespace limn::image_formats {

/// An image as its file stores it: rows from the top as stored, no orientation applied.
struct StoredImage {
  cv::Mat samples;        ///< 8 or 16 bits; grey, BGR, or BGRA with colours not multiplied by alpha.
  int white = 255;        ///< The level of white.
  bool is_stated = true;  ///< Whether the file states the white. 16-bit PNG and TIFF files do not.
  std::string note = {};  ///< What the file has that is not read, for a warning; empty: nothing.
};

/// The formats that are read.
enum class Format { png, jpeg, pnm, bmp, tiff, webp, tga };

/// Decode a whole file each. An error's message begins with "expected" and does not name the file. A
/// truncated or damaged file is an error, and so is an image larger than check_size() allows, which is found
/// before its pixels are decoded. With `grey`, colours may already be converted to grey.
Result<StoredImage> decode_png(std::string_view bytes, bool grey);
Result<StoredImage> decode_jpeg(std::string_view bytes, bool grey);
Result<StoredImage> decode_pnm(std::string_view bytes);
Result<StoredImage> decode_bmp(std::string_view bytes);
Result<StoredImage> decode_tiff(std::string_view bytes);
Result<StoredImage> decode_webp(std::string_view bytes);
Result<StoredImage> decode_tga(std::string_view bytes);

/// Whether the bytes begin with the header of a TGA file, which has no signature of its own.
bool is_tga(std::string_view bytes);

/// Error if an image of this size is not read: no pixels, more than k_max_image_side or k_max_image_pixels.
Status check_size(long width, long height);

/// The error of a file that ends too early or is damaged. `reason` may be empty.
Error damaged(std::string_view format, std::string_view bytes, std::string_view reason);

/// An unsigned number of `count` bytes at an offset that exists, the least significant byte first.
unsigned little_endian(std::string_view bytes, std::size_t at, std::size_t count);

/// Divides the colours of a BGRA image, which are multiplied by alpha, by it.
void undo_multiplied_alpha(cv::Mat* bgra, int white);

/// Removes an alpha channel that is zero everywhere: programs that know no alpha leave it empty.
void drop_empty_alpha(cv::Mat* image);

}  // namespace limn::image_formats
