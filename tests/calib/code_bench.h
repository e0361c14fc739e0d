#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "calib/code/patterns.h"
#include "core/file.h"
#include "core/image_io.h"
#include "tests/support/matchers.h"

namespace limn::test {

/// A camera in front of a projector: its pixels lie on straight lines of the projector's image. It computes
/// exact light, then adds blur, gain and noise.
struct CodeBench {
  calib::Patterns patterns = calib::Patterns::create(calib::PatternCode::gray, 64, 64).value();
  int width = 160, height = 120;
  double white = 180, black = 20;  // levels
  // Standard deviation of the projector's blur, projector pixels.
  double blur = 0.3;
  double noise = 0;                                 // levels
  double gamma = 1;                                 // gamma of the projector: light = value ^ gamma
  std::array<double, 3> channel_gamma = {1, 1, 1};  // multiplies it in blue, green, red; the camera is grey
  /// Displacement of all that the camera sees in image number `index`, camera pixels; none by default.
  std::function<Eigen::Vector2d(int index)> shift_px;
  /// May change the light of image number `index` as the camera sees it, 0 to 1, before it is photographed.
  std::function<void(int index, cv::Mat* light)> changed;
  std::mt19937_64 rng = test_rng();

  // Position in the projector's image of the centre of a camera pixel.
  double column_at(double x) const { return 5.3 + 0.35 * x; }
  double row_at(double y) const { return 3.1 + 0.4 * y; }

  /// Light at the camera pixels: the image's pixels are squares, blurred. CV_64F.
  cv::Mat light(const cv::Mat& image, const Eigen::Vector2d& shift = Eigen::Vector2d::Zero()) const {
    cv::Mat linear(image.size(), CV_64F);
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x)
        linear.at<double>(y, x) =
            (light_of(image, y, x, 0) + light_of(image, y, x, 1) + light_of(image, y, x, 2)) / 3;
    }
    const auto columns = weights(width, image.cols, [&](int x) { return column_at(x - shift.x()); });
    const auto rows = weights(height, image.rows, [&](int y) { return row_at(y - shift.y()); });
    return rows * linear * columns.t();
  }

  /// All images of the code, 8 bits.
  std::vector<cv::Mat> photographs() {
    std::normal_distribution<double> scatter(0, 1);
    std::vector<cv::Mat> photos;
    for (int i = 0; i < patterns.count(); ++i) {
      cv::Mat seen = light(patterns.image(i), shift_px ? shift_px(i) : Eigen::Vector2d(0, 0));
      if (changed) changed(i, &seen);
      cv::Mat photo(height, width, CV_8U);
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x)
          photo.at<uchar>(y, x) = cv::saturate_cast<uchar>(black + (white - black) * seen.at<double>(y, x) +
                                                           noise * scatter(rng));
      }
      photos.push_back(photo);
    }
    return photos;
  }

  std::vector<std::filesystem::path> photograph(const std::filesystem::path& folder) {
    EXPECT_TRUE(make_folder(folder).ok());
    std::vector<std::filesystem::path> files;
    for (const cv::Mat& photo : photographs()) {
      files.push_back(folder / calib::image_name(static_cast<int>(files.size())));
      EXPECT_TRUE(write_png(files.back(), photo, {.compression = 1}).ok());
    }
    return files;
  }

 private:
  double light_of(const cv::Mat& image, int y, int x, int channel) const {
    const uchar* pixel = image.ptr(y, x);
    const double value = pixel[image.channels() == 1 ? 0 : channel] / 255.0;
    return std::pow(value, gamma * channel_gamma[static_cast<size_t>(channel)]);
  }

  // Weight of each projector pixel of a line for each camera pixel.
  cv::Mat weights(int camera, int projector, const std::function<double(int)>& place) const {
    cv::Mat weights(camera, projector, CV_64F);
    for (int i = 0; i < camera; ++i) {
      for (int k = 0; k < projector; ++k) {
        const auto edge = [&](double d) { return 0.5 * (1 + std::erf(d / (blur * std::sqrt(2.0)))); };
        weights.at<double>(i, k) = edge(k + 0.5 - place(i)) - edge(k - 0.5 - place(i));
      }
    }
    return weights;
  }
};

}  // namespace limn::test
