#include "apps/page.h"

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

cv::Mat at_most_wide(const cv::Mat& picture, int width) {
  if (picture.cols <= width) return picture;
  cv::Mat scaled;
  cv::resize(picture, scaled, {width, picture.rows * width / picture.cols}, 0, 0, cv::INTER_AREA);
  return scaled;
}

}  // namespace limn
