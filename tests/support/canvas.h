#pragma once

#include <chrono>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <utility>

#include "device/display.h"

namespace limn::test {

/// A display that remembers what it was shown; its light leaves 20 ms later.
class Canvas : public device::Display {
 public:
  Canvas(std::string name, cv::Size size) : name_(std::move(name)), size_(size) {}
  const std::string& name() const override { return name_; }
  cv::Size size() const override { return size_; }
  Result<Stamp> show(const cv::Mat& image) override {
    if (image.size() != size_) return error("{}: expected its size, found another.", name_);
    shown = image.clone();
    ++count;
    if (const int lit = cv::countNonZero(image.reshape(1)); lit > most_lit) {
      most_lit = lit;
      most_lit_image = shown;
    }
    if (on_show) on_show();
    return shifted(std::chrono::steady_clock::now(), 0.020);
  }
  cv::Mat shown;
  int count = 0;     ///< images shown
  int most_lit = 0;  ///< the largest number of bytes over 0 in an image
  /// The image with them. The last one may be black: on a slow machine poses are too old by then.
  cv::Mat most_lit_image;
  /// Called after each image, by the thread that shows it. A test of a session ends it here, as soon as it
  /// has shown what the test looks at: how long that takes depends on the machine.
  std::function<void()> on_show;

 private:
  std::string name_;
  cv::Size size_;
};

}  // namespace limn::test
