#include <opencv2/videoio.hpp>

#include "core/program_library.h"
#include "device/video_reader.h"

namespace limn::device {
namespace {

class OpenCvVideoReader : public VideoReader {
 public:
  bool open(const std::string& source, const std::vector<int>& limits_ms) override {
    if (limits_ms.empty()) return video_.open(source, cv::CAP_FFMPEG);
    return video_.open(
        source, cv::CAP_FFMPEG,
        {cv::CAP_PROP_OPEN_TIMEOUT_MSEC, limits_ms.at(0), cv::CAP_PROP_READ_TIMEOUT_MSEC, limits_ms.at(1)});
  }
  bool is_open() const override { return video_.isOpened(); }
  void close() override { video_.release(); }
  cv::Size size() const override {
    return {static_cast<int>(video_.get(cv::CAP_PROP_FRAME_WIDTH)),
            static_cast<int>(video_.get(cv::CAP_PROP_FRAME_HEIGHT))};
  }
  bool grab() override { return video_.grab(); }
  double position_s() const override { return video_.get(cv::CAP_PROP_POS_MSEC) / 1000; }
  bool retrieve(cv::Mat* image) override { return video_.retrieve(*image); }

 private:
  cv::VideoCapture video_;
};

}  // namespace
}  // namespace limn::device

LIMN_LIBRARY_VERSION(LIMN_VERSION)

extern "C" __attribute__((visibility("default"))) limn::device::VideoReader* limn_make_video_reader() {
  return new limn::device::OpenCvVideoReader();
}
