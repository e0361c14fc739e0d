#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfRgbaFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStdIO.h>

#include <cstring>
#include <stdexcept>
#include <vector>

#include "core/program_library.h"
#include "scene/files/exr_image.h"

namespace limn::scene {
namespace {

class ExrBytes final : public Imf::IStream {
 public:
  ExrBytes(std::string_view bytes, const std::string& name) : IStream(name.c_str()), bytes_(bytes) {}
  bool read(char to[], int count) override {
    if (count < 0 || static_cast<std::size_t>(count) > bytes_.size() - at_)
      throw std::runtime_error("the file ends too early");
    std::memcpy(to, bytes_.data() + at_, static_cast<std::size_t>(count));
    at_ += static_cast<std::size_t>(count);
    return at_ < bytes_.size();
  }
  decltype(std::declval<Imf::IStream&>().tellg()) tellg() override { return at_; }
  void seekg(decltype(std::declval<Imf::IStream&>().tellg()) at) override {
    if (at > bytes_.size()) throw std::runtime_error("the file ends too early");
    at_ = static_cast<std::size_t>(at);
  }

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
};

Result<cv::Mat> decoded(std::string_view bytes, const std::string& name) {
  try {
    Imf::Header::setMaxImageSize(k_most_hdr_width,
                                 k_most_hdr_height);  // before it makes tables of rows and tiles
    Imf::Header::setMaxTileSize(k_most_hdr_width, k_most_hdr_height);
    ExrBytes stream(bytes, name);
    Imf::RgbaInputFile file(stream);
    if ((file.channels() & (Imf::WRITE_RGB | Imf::WRITE_Y)) == 0)
      return error(
          "{}: expected an OpenEXR image with channels R, G and B, found others. Export it as a plain image, "
          "without layers.",
          name);
    const Imath::Box2i window = file.dataWindow();
    const long width = static_cast<long>(window.max.x) - window.min.x + 1,
               height = static_cast<long>(window.max.y) - window.min.y + 1;
    LIMN_TRY_STATUS(check_hdr_size(name, width, height));
    std::vector<Imf::Rgba> pixels(static_cast<std::size_t>(width * height));
    file.setFrameBuffer(pixels.data() - window.min.x - window.min.y * width, 1,
                        static_cast<std::size_t>(width));
    file.readPixels(window.min.y, window.max.y);
    cv::Mat image(static_cast<int>(height), static_cast<int>(width), CV_32FC3);
    for (int y = 0; y < image.rows; ++y)
      for (int x = 0; x < image.cols; ++x) {
        const Imf::Rgba& pixel = pixels[static_cast<std::size_t>(y * width + x)];
        image.at<cv::Vec3f>(y, x) = {pixel.b, pixel.g, pixel.r};
      }
    return image;
  } catch (const std::exception& failed) {
    return error("{}: expected an OpenEXR image, but it cannot be read: {}.", name, failed.what());
  }
}

std::string encoded(const cv::Mat& image, const std::string& comment) {
  Imf::Header header(image.cols, image.rows);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::addComments(header, comment);
  Imf::FrameBuffer channels;
  const char* names[] = {"R", "G", "B"};
  for (std::size_t c = 0; c < 3; ++c) {
    header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
    channels.insert(names[c], Imf::Slice(Imf::FLOAT, const_cast<char*>(image.ptr<char>()) + c * sizeof(float),
                                         image.elemSize(), image.step[0]));
  }
  Imf::StdOSStream stream;
  {
    Imf::OutputFile file(stream, header);
    file.setFrameBuffer(channels);
    file.writePixels(image.rows);
  }
  return stream.str();
}

}  // namespace
}  // namespace limn::scene

LIMN_LIBRARY_VERSION(LIMN_VERSION)

extern "C" __attribute__((visibility("default"))) void limn_decode_exr(std::string_view bytes,
                                                                       const std::string& name,
                                                                       limn::Result<cv::Mat>* image) {
  *image = limn::scene::decoded(bytes, name);
}

extern "C" __attribute__((visibility("default"))) void limn_encode_exr(const cv::Mat& image,
                                                                       const std::string& comment,
                                                                       std::string* bytes) {
  *bytes = limn::scene::encoded(image, comment);
}
