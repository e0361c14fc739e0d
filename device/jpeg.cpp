#include "device/jpeg.h"

#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "core/image_encoder.h"
#include "core/image_io.h"

namespace limn::device {
namespace {

constexpr long k_max_pixels = 200'000'000;  // the largest sensors have this; more means a damaged header

// After a warning libjpeg continues. Extra bytes between segments are harmless; other faults damage the
// image.
bool is_harmless(const std::string& warning) {
  return warning.find("extraneous bytes before marker") != std::string::npos;
}

// A JPEG that has its end mark. Some webcams leave it out; with it, libjpeg tells whether data are missing,
// too.
class EndedJpeg {
 public:
  explicit EndedJpeg(std::span<const std::uint8_t> bytes) : bytes_(bytes) {
    static constexpr std::array<std::uint8_t, 2> k_end = {0xff, 0xd9};
    constexpr std::size_t k_most_padding = 64;  // bytes behind the end mark
    const auto tail = bytes.last(std::min(bytes.size(), k_most_padding + k_end.size()));
    if (std::search(tail.begin(), tail.end(), k_end.begin(), k_end.end()) != tail.end()) return;
    copy_.assign(bytes.begin(), bytes.end());
    copy_.insert(copy_.end(), k_end.begin(), k_end.end());
    bytes_ = copy_;
  }
  EndedJpeg(const EndedJpeg&) = delete;
  EndedJpeg& operator=(const EndedJpeg&) = delete;
  std::span<const std::uint8_t> bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> copy_;
  std::span<const std::uint8_t> bytes_;
};

using Handle = std::unique_ptr<void, int (*)(tjhandle)>;

Handle new_decoder() {
  Handle decoder(tjInitDecompress(), tjDestroy);
  LIMN_CHECK(decoder != nullptr);
  return decoder;
}

Error damaged(std::span<const std::uint8_t> bytes, const Handle& decoder) {
  return error("expected a complete JPEG image, found a truncated or damaged one ({} bytes: {}).",
               bytes.size(), tjGetErrorStr2(decoder.get()));
}

// Whether the image is complete in spite of the decoder's warning.
bool is_whole(const Handle& decoder) {
  return tjGetErrorCode(decoder.get()) == TJERR_WARNING && is_harmless(tjGetErrorStr2(decoder.get()));
}

struct Header {
  cv::Size size;
  int subsampling = 0, colours = 0;
};

Result<Header> read_header(std::span<const std::uint8_t> bytes,
                           const JpegOptions& options,
                           const Handle& decoder) {
  Header header;
  int width = 0, height = 0;
  if (tjDecompressHeader3(decoder.get(), bytes.data(), bytes.size(), &width, &height, &header.subsampling,
                          &header.colours) != 0 ||
      width < 1 || height < 1)  // a header that ends too early
    return damaged(bytes, decoder);
  header.size = {width, height};
  if (!options.size.empty() && header.size != options.size)
    return error("expected an image of {}x{}, found {}x{}. Reset the camera's size or start again.",
                 options.size.width, options.size.height, width, height);
  if (static_cast<long>(width) * height > k_max_pixels)
    return error("expected an image of at most 200 megapixels, found one of {}x{} pixels.", width, height);
  return header;
}

// The luma plane and the two chroma planes, each at its own resolution.
using Planes = std::array<cv::Mat, 3>;

Result<Planes> decode_planes(std::span<const std::uint8_t> bytes,
                             const Header& header,
                             const Handle& decoder) {
  Planes planes;
  std::array<unsigned char*, 3> data{};
  std::array<int, 3> strides{};
  for (std::size_t i = 0; i < 3; ++i) {
    const int plane = static_cast<int>(i);
    planes[i].create(tjPlaneHeight(plane, header.size.height, header.subsampling),
                     tjPlaneWidth(plane, header.size.width, header.subsampling), CV_8UC1);
    data[i] = planes[i].data;
    strides[i] = static_cast<int>(planes[i].step);
  }
  const int done = tjDecompressToYUVPlanes(decoder.get(), bytes.data(), bytes.size(), data.data(),
                                           header.size.width, strides.data(), header.size.height, 0);
  if (done != 0 && !is_whole(decoder)) return damaged(bytes, decoder);
  return planes;
}

cv::Mat coloured(const Planes& planes, const Header& header, const Handle& decoder) {
  cv::Mat image(header.size, CV_8UC3);
  std::array<const unsigned char*, 3> data{};
  std::array<int, 3> strides{};
  for (std::size_t i = 0; i < 3; ++i) {
    data[i] = planes[i].data;
    strides[i] = static_cast<int>(planes[i].step);
  }
  LIMN_CHECK(tjDecodeYUVPlanes(decoder.get(), data.data(), strides.data(), header.subsampling, image.data,
                               image.cols, static_cast<int>(image.step), image.rows, TJPF_BGR, 0) == 0);
  return image;
}

// The largest n/8 of a size with no side longer than `longest_side`.
cv::Size reduced(cv::Size size, int longest_side) {
  if (longest_side <= 0) return size;
  for (int eighths = 8; eighths > 1; --eighths) {
    const tjscalingfactor factor{eighths, 8};
    const cv::Size out(TJSCALED(size.width, factor), TJSCALED(size.height, factor));
    if (std::max(out.width, out.height) <= longest_side) return out;
  }
  constexpr tjscalingfactor k_least{1, 8};
  return {TJSCALED(size.width, k_least), TJSCALED(size.height, k_least)};
}

}  // namespace

Result<cv::Size> jpeg_size(std::span<const std::uint8_t> bytes) {
  const Handle decoder = new_decoder();
  int width = 0, height = 0, subsampling = 0, colours = 0;
  if (tjDecompressHeader3(decoder.get(), bytes.data(), bytes.size(), &width, &height, &subsampling,
                          &colours) != 0 ||
      width < 1 || height < 1)  // a header that ends too early
    return damaged(bytes, decoder);
  return cv::Size(width, height);
}

Result<cv::Mat> decode_jpeg(std::span<const std::uint8_t> stored, const JpegOptions& options) {
  const EndedJpeg ended(stored);
  const std::span bytes = ended.bytes();
  const Handle decoder = new_decoder();
  LIMN_TRY(const Header header, read_header(bytes, options, decoder));
  const bool grey = options.grey || header.colours == TJCS_GRAY;
  cv::Mat image(reduced(header.size, options.longest_side), grey ? CV_8UC1 : CV_8UC3);
  const int done = tjDecompress2(decoder.get(), bytes.data(), bytes.size(), image.data, image.cols,
                                 static_cast<int>(image.step), image.rows, grey ? TJPF_GRAY : TJPF_BGR, 0);
  if (done != 0 && !is_whole(decoder)) return damaged(bytes, decoder);
  return image;
}

Result<Frame> decode_frame(std::string jpeg, const JpegOptions& options) {
  const EndedJpeg ended({reinterpret_cast<const std::uint8_t*>(jpeg.data()), jpeg.size()});
  const std::span bytes = ended.bytes();
  const Handle decoder = new_decoder();
  LIMN_TRY(const Header header, read_header(bytes, options, decoder));
  Frame frame;
  if (options.grey || header.colours != TJCS_YCbCr || header.subsampling < 0) {
    LIMN_TRY(frame.image, decode_jpeg(bytes, {.grey = options.grey}));
    frame.grey = to_grey(frame.image);
  } else {
    LIMN_TRY(const Planes planes, decode_planes(bytes, header, decoder));
    frame.image = coloured(planes, header, decoder);
    frame.grey = planes[0](cv::Rect({}, header.size));
  }
  if (!options.grey) frame.jpeg = std::make_shared<const std::string>(std::move(jpeg));
  return frame;
}

std::vector<std::uint8_t> encode_jpeg(const cv::Mat& image, int quality) {
  const std::string jpeg = limn::encode_jpeg(image, quality);
  return {jpeg.begin(), jpeg.end()};
}

}  // namespace limn::device
