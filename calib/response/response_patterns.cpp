#include "calib/response/response_patterns.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "calib/code/patterns.h"
#include "core/file.h"
#include "core/json_text.h"

namespace limn::calib {
namespace {

using Role = ResponseImage::Role;

const cv::Vec3b k_black(0, 0, 0), k_white(255, 255, 255);

uchar ramp_level(int step) { return static_cast<uchar>(std::lround(255.0 * step / k_ramp_levels)); }

std::vector<ResponseImage> make_images() {
  std::vector<ResponseImage> images = {{Role::black, k_black}, {Role::white, k_white}};
  // Single shares, three quarters and two kinds of halves: every level from dark to full in most pixels, and
  // sums that must agree (calib/response/camera_response.h).
  for (const unsigned shares : {1U, 2U, 4U, 8U, 6U, 9U, 7U, 14U})
    images.push_back({Role::share, k_white, shares});
  images.push_back({Role::border, k_white});
  for (int channel = 2; channel >= 0; --channel) {  // red first
    for (int step = 1; step <= k_ramp_levels; ++step) {
      cv::Vec3b bgr = k_black;
      bgr[channel] = ramp_level(step);
      images.push_back({Role::ramp, bgr});
    }
    images.push_back({Role::black, k_black});
  }
  for (const int step : {3, 6, 9}) images.push_back({Role::grey, cv::Vec3b::all(ramp_level(step))});
  for (const cv::Vec3b& bgr : {cv::Vec3b(70, 150, 230), cv::Vec3b(200, 190, 60), cv::Vec3b(120, 40, 90)})
    images.push_back({Role::check, bgr});
  images.push_back({Role::white, k_white});
  return images;
}

}  // namespace

std::string ResponseImage::what() const {
  switch (role) {
    case Role::black:
      return "black";
    case Role::white:
      return "white";
    case Role::share:
      return fmt::format("white on the pixel shares {:04b}", shares);
    case Role::border:
      return "white border";
    default:
      return fmt::format("red {}, green {}, blue {}", bgr[2], bgr[1], bgr[0]);
  }
}

const std::vector<ResponseImage>& response_images() {
  static const std::vector<ResponseImage> images = make_images();
  return images;
}

cv::Mat draw_response(int index, int width, int height) {
  const ResponseImage& shown = response_images().at(static_cast<size_t>(index));
  cv::Mat image(height, width, CV_8UC3, cv::Scalar(shown.bgr[0], shown.bgr[1], shown.bgr[2]));
  if (shown.role == Role::border) {
    const int border = std::max(2, static_cast<int>(std::lround(k_border * std::min(width, height))));
    const cv::Rect inside(border, border, width - 2 * border, height - 2 * border);
    if (inside.width > 0 && inside.height > 0) image(inside).setTo(cv::Scalar::all(0));
  }
  if (shown.shares == 15) return image;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if ((shown.shares >> (x % 2 + 2 * (y % 2)) & 1) == 0) image.at<cv::Vec3b>(y, x) = k_black;
  return image;
}

Status save_response_patterns(int width, int height, const std::filesystem::path& path) {
  nlohmann::ordered_json json = {{"schema", "limn.response_patterns/1"},
                                 {"size", {width, height}},
                                 {"pictures", nlohmann::ordered_json::array()}};
  for (size_t i = 0; i < response_images().size(); ++i)
    json["pictures"].push_back(
        {{"file", image_name(static_cast<int>(i))}, {"shows", response_images()[i].what()}});
  return write_file(path, json_text(json, 1) + "\n");
}

}  // namespace limn::calib
