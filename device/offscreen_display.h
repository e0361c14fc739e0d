#pragma once

#include <utility>

#include "device/display.h"

namespace limn::device {

/// A display without light: it only stores the last image.
class OffscreenDisplay : public Display {
 public:
  OffscreenDisplay(std::string name, cv::Size size, double latency_s = 0)
      : name_(std::move(name)), size_(size), latency_s_(latency_s) {}

  const std::string& name() const override { return name_; }
  cv::Size size() const override { return size_; }
  Result<Stamp> show(const cv::Mat& image) override;
  const cv::Mat& image() const { return image_; }

 private:
  std::string name_;
  cv::Size size_;
  double latency_s_;
  cv::Mat image_;
};

/// Checks that a display of that name and size can show the image, which must be 8-bit grey or BGR.
Status check_image(const cv::Mat& image, const std::string& name, cv::Size size);

}  // namespace limn::device
