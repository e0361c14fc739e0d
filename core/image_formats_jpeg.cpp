#include <csetjmp>
#include <cstdio>

// jpeglib.h needs <cstdio> before it.
#include <jerror.h>
#include <jpeglib.h>

#include <opencv2/core.hpp>

#include "core/image_formats.h"

namespace limn::image_formats {
namespace {

constexpr int k_max_scans = 500;  // a progressive image has some ten; thousands only cost time

// Faults of a file after which its image is complete: extra bytes between segments, and application segments
// of an unknown version.
bool is_harmless(int message) {
  return message == JWRN_EXTRANEOUS_DATA || message == JWRN_JFIF_MAJOR || message == JWRN_ADOBE_XFORM ||
         message == JWRN_TOO_MUCH_DATA;
}

// Where the image starts. Some cameras send an empty image first: one that ends before it has a scan.
std::size_t start_of_image(std::string_view bytes) {
  std::size_t start = 0;
  for (std::size_t at = 2; at + 4 <= bytes.size() && bytes[at] == '\xff';) {
    const char marker = bytes[at + 1];
    if (marker == '\xd8') {
      start = at;
      at += 2;
    } else if (marker == '\xd9') {
      start = bytes.find("\xff\xd8\xff", at);
      if (start == std::string_view::npos) return 0;
      at = start + 2;
    } else if (marker == '\xff') {
      ++at;
    } else if (marker == '\xda') {
      return start;
    } else {
      at += 2 + 256u * static_cast<unsigned char>(bytes[at + 2]) + static_cast<unsigned char>(bytes[at + 3]);
    }
  }
  return start;
}

// Adobe's programs store the amount of light in the four channels, all others the amount of ink.
cv::Mat bgr_of(const cv::Mat& cmyk, bool is_light) {
  cv::Mat bgr(cmyk.size(), CV_8UC3);
  const int inverted = is_light ? 0 : 255;
  for (int y = 0; y < cmyk.rows; ++y) {
    const auto* in = cmyk.ptr<cv::Vec4b>(y);
    auto* out = bgr.ptr<cv::Vec3b>(y);
    for (int x = 0; x < cmyk.cols; ++x)
      for (int k = 0; k < 3; ++k)
        out[x][k] = static_cast<uchar>(((in[x][2 - k] ^ inverted) * (in[x][3] ^ inverted) + 127) / 255);
  }
  return bgr;
}

// libjpeg returns from an error by longjmp: functions that it may leave that way hold no objects with a
// destructor.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {
    decoder_.err = jpeg_std_error(&errors_);
    errors_.error_exit = [](j_common_ptr decoder) { reader_of(decoder).fail(); };
    errors_.emit_message = [](j_common_ptr decoder, int level) {
      if (level < 0 && !is_harmless(decoder->err->msg_code)) reader_of(decoder).fail();
    };
    errors_.output_message = [](j_common_ptr) {};
    decoder_.client_data = this;
    progress_.progress_monitor = [](j_common_ptr decoder) {
      if (reinterpret_cast<j_decompress_ptr>(decoder)->input_scan_number > k_max_scans)
        reader_of(decoder).fail("too many scans");
    };
  }
  ~Reader() { jpeg_destroy_decompress(&decoder_); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  Result<StoredImage> read(bool grey) {
    if (!read_header()) return damaged("JPEG", bytes_, reason_);
    LIMN_TRY_STATUS(check_size(decoder_.image_width, decoder_.image_height));
    if (!has_enough_bytes()) return damaged("JPEG", bytes_, "the file ends too early");
    choose_colours(grey);
    const int height = static_cast<int>(decoder_.image_height),
              width = static_cast<int>(decoder_.image_width);
    image_.create(height, width, CV_8UC(channels_));
    if (!read_rows()) return damaged("JPEG", bytes_, reason_);
    if (has_ended_ && is_scan_missing_) return damaged("JPEG", bytes_, "its last scans are missing");
    if (channels_ == 4) image_ = bgr_of(image_, is_light_);
    return StoredImage{image_};
  }

 private:
  static Reader& reader_of(j_common_ptr decoder) { return *static_cast<Reader*>(decoder->client_data); }

  [[noreturn]] void fail(const char* reason = nullptr) {
    if (reason)
      std::snprintf(reason_, sizeof reason_, "%s", reason);
    else
      errors_.format_message(reinterpret_cast<j_common_ptr>(&decoder_), reason_);
    std::longjmp(jump_, 1);
  }

  // A file without an end marker gets one. If data are missing before it, the decoder warns of that.
  static boolean end_file(j_decompress_ptr decoder) {
    static constexpr JOCTET k_end[] = {0xff, JPEG_EOI};
    reader_of(reinterpret_cast<j_common_ptr>(decoder)).has_ended_ = true;
    decoder->src->next_input_byte = k_end;
    decoder->src->bytes_in_buffer = sizeof k_end;
    return TRUE;
  }

  bool read_header() {
    if (setjmp(jump_) != 0) return false;
    jpeg_create_decompress(&decoder_);
    decoder_.progress = &progress_;
    jpeg_mem_src(&decoder_, reinterpret_cast<const unsigned char*>(bytes_.data()), bytes_.size());
    decoder_.src->fill_input_buffer = end_file;
    jpeg_read_header(&decoder_, TRUE);
    return true;
  }

  // Huffman codes take at least one bit for 8x8 pixels. Without this check, a short file with a great size in
  // its header takes gigabytes of memory.
  bool has_enough_bytes() const {
    const auto pixels = static_cast<std::size_t>(decoder_.image_width) * decoder_.image_height;
    return decoder_.arith_code || bytes_.size() * 8 * DCTSIZE2 >= pixels;
  }

  void choose_colours(bool grey) {
    const J_COLOR_SPACE stored = decoder_.jpeg_color_space;
    is_light_ = decoder_.saw_Adobe_marker;
    channels_ = stored == JCS_CMYK || stored == JCS_YCCK ? 4 : grey || stored == JCS_GRAYSCALE ? 1 : 3;
    decoder_.out_color_space = channels_ == 4 ? JCS_CMYK : channels_ == 1 ? JCS_GRAYSCALE : JCS_EXT_BGR;
  }

  bool read_rows() {
    if (setjmp(jump_) != 0) return false;
    jpeg_start_decompress(&decoder_);
    while (decoder_.output_scanline < decoder_.output_height) {
      JSAMPROW row = image_.ptr(static_cast<int>(decoder_.output_scanline));
      jpeg_read_scanlines(&decoder_, &row, 1);
    }
    find_missing_scans();
    jpeg_finish_decompress(&decoder_);
    return true;
  }

  // A scan can be missing for a whole colour, or for the last bits of a progressive image's coefficients.
  void find_missing_scans() {
    for (int i = 0; i < decoder_.num_components; ++i) {
      if (decoder_.comp_info[i].quant_table == nullptr) is_scan_missing_ = true;
      for (int k = 0; k < DCTSIZE2 && decoder_.coef_bits != nullptr; ++k)
        if (decoder_.coef_bits[i][k] != 0) is_scan_missing_ = true;
    }
  }

  std::string_view bytes_;
  jpeg_error_mgr errors_{};
  jpeg_progress_mgr progress_{};
  jpeg_decompress_struct decoder_{};
  std::jmp_buf jump_{};
  char reason_[JMSG_LENGTH_MAX] = "";
  cv::Mat image_;
  int channels_ = 3;
  bool is_light_ = false;         // a CMYK image holds light instead of ink
  bool has_ended_ = false;        // the decoder needed more than the file has
  bool is_scan_missing_ = false;  // valid after read_rows()
};

}  // namespace

Result<StoredImage> decode_jpeg(std::string_view bytes, bool grey) {
  return Reader(bytes.substr(start_of_image(bytes))).read(grey);
}

}  // namespace limn::image_formats
