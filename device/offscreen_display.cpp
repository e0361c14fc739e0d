#include "device/offscreen_display.h"

#include <chrono>

namespace limn::device {

Status fits(const cv::Mat& picture, const std::string& name, cv::Size size) {
  if (picture.size() == size && (picture.type() == CV_8UC1 || picture.type() == CV_8UC3)) return {};
  return error(
      "{}: expected an 8-bit grey or BGR picture of {}x{}, found {}x{} with {} channels of {} bytes.", name,
      size.width, size.height, picture.cols, picture.rows, picture.channels(), picture.elemSize1());
}

Result<Stamp> OffscreenDisplay::show(const cv::Mat& picture) {
  LIMN_TRY_STATUS(fits(picture, name_, size_));
  picture_ = picture.clone();
  return shifted(std::chrono::steady_clock::now(), latency_s_);
}

}  // namespace limn::device
