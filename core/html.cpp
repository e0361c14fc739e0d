#include "core/html.h"

#include <opencv2/imgproc.hpp>

namespace limn {

std::string escaped(const std::string& text) {
  std::string html;
  for (const char c : text) {
    if (c == '<')
      html += "&lt;";
    else if (c == '>')
      html += "&gt;";
    else if (c == '&')
      html += "&amp;";
    else
      html += c;
  }
  return html;
}

cv::Mat at_most_wide(const cv::Mat& image, int width) {
  if (image.cols <= width) return image;
  cv::Mat scaled;
  cv::resize(image, scaled, {width, image.rows * width / image.cols}, 0, 0, cv::INTER_AREA);
  return scaled;
}

}  // namespace limn
