#include "exchange/exr.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStdIO.h>

#include "core/result.h"

namespace limn::exchange {

std::string exr_bytes(const cv::Mat& image, const std::string& comment) {
  LIMN_CHECK(image.type() == CV_32FC3);
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

}  // namespace limn::exchange
