#include "device/offscreen_display.h"

#include <chrono>

namespace limn::device {

Status check_image(const cv::Mat& image, const std::string& name, cv::Size size) {
  if (image.size() == size && (image.type() == CV_8UC1 || image.type() == CV_8UC3)) return {};
  return error("{}: expected an 8-bit grey or BGR image of {}x{}, found {}x{} with {} channels of {} bytes.",
               name, size.width, size.height, image.cols, image.rows, image.channels(), image.elemSize1());
}

Result<Stamp> OffscreenDisplay::show(const cv::Mat& image) {
  LIMN_TRY_STATUS(check_image(image, name_, size_));
  image_ = image.clone();
  return shifted(std::chrono::steady_clock::now(), latency_s_);
}

}  // namespace limn::device
