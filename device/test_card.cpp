#include "device/test_card.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>

namespace limn::device {
namespace {

struct Colour {
  const char* name;
  cv::Scalar bgr;
};

const Colour& colour_of(int number) {
  static const std::array<Colour, 6> k_colours = {{{"red", {60, 60, 255}},
                                                   {"green", {60, 255, 60}},
                                                   {"blue", {255, 100, 60}},
                                                   {"yellow", {40, 255, 255}},
                                                   {"magenta", {255, 60, 255}},
                                                   {"cyan", {255, 255, 40}}}};
  return k_colours[static_cast<std::size_t>(std::max(0, number - 1)) % k_colours.size()];
}

}  // namespace

const char* sign_colour(int number) { return colour_of(number).name; }

cv::Mat output_sign(cv::Size size, int number, const std::string& name) {
  cv::Mat image(size, CV_8UC3, colour_of(number).bgr);
  const auto write = [&](const std::string& text, double height, double baseline) {
    const double scale = height * size.height / 22;  // capitals of the Hershey font are 22 pixels high
    const int thickness = std::max(1, static_cast<int>(2 * scale));
    const int width = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, scale, thickness, nullptr).width;
    const double fit = std::min(1.0, 0.9 * size.width / std::max(1, width));
    cv::putText(image, text,
                {static_cast<int>((size.width - fit * width) / 2), static_cast<int>(baseline * size.height)},
                cv::FONT_HERSHEY_SIMPLEX, fit * scale, cv::Scalar(),
                std::max(1, static_cast<int>(fit * thickness)), cv::LINE_AA);
  };
  write(std::to_string(number), 0.45, 0.6);
  write(fmt::format("{} {}x{}", name, size.width, size.height), 0.06, 0.75);
  cv::rectangle(image, cv::Rect({}, size), cv::Scalar::all(255));
  const cv::Rect patch(size.width * 2 / 5, size.height * 4 / 5, size.width / 5, size.height / 8);
  for (int y = patch.y; y < patch.br().y; ++y)
    for (int x = patch.x; x < patch.br().x; ++x)
      image.at<cv::Vec3b>(y, x) = (x + y) % 2 ? cv::Vec3b(255, 255, 255) : cv::Vec3b(0, 0, 0);
  return image;
}

}  // namespace limn::device
