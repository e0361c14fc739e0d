#include "wizard/capture/exposure_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "core/image_io.h"
#include "core/median.h"
#include "device/test_card.h"

namespace limn::wizard {
namespace {

constexpr double k_lit_levels = 12;    // minimum of white minus black for a lit pixel
constexpr double k_least_lit = 0.005;  // share of the image; below it, the camera does not see the projector
constexpr int k_full = 253;            // grey level that counts as saturated
constexpr double k_many = 0.02;        // share of the lit pixels that may be saturated
constexpr double k_dark = 90;          // minimum grey level that a tenth of the lit pixels should reach
constexpr double k_wanted = 170;       // best value of that level
constexpr double k_blurred_px = 2.5;   // half a cell of the board's markers in a small image
constexpr int k_squares = 16;          // number of squares across the projector's image

// Standard deviation of the blur of the squares' edges, camera pixels; 0 if there are too few edges.
double blur_of(const cv::Mat& black, const cv::Mat& white, const cv::Mat& pattern, const cv::Mat& lit) {
  cv::Mat range, share;
  cv::subtract(white, black, range, cv::noArray(), CV_32F);
  cv::subtract(pattern, black, share, cv::noArray(), CV_32F);
  cv::divide(share, cv::max(range, 1.0), share);
  cv::Mat inside;
  cv::erode(lit, inside, cv::Mat(), {-1, -1}, 3);
  std::vector<float> slopes;
  for (int y = 1; y + 1 < share.rows; ++y) {
    for (int x = 1; x + 1 < share.cols; ++x) {
      const float here = share.at<float>(y, x);
      if (!inside.at<std::uint8_t>(y, x) || here < 0.35F || here > 0.65F) continue;
      const float dx = (share.at<float>(y, x + 1) - share.at<float>(y, x - 1)) / 2,
                  dy = (share.at<float>(y + 1, x) - share.at<float>(y - 1, x)) / 2;
      slopes.push_back(std::hypot(dx, dy));
    }
  }
  if (slopes.size() < 50) return 0;
  const auto middle = median(std::move(slopes));
  return middle > 0 ? 1 / (middle * std::sqrt(2 * std::numbers::pi)) : 0;
}

}  // namespace

std::vector<std::string> ExposureReading::advice() const {
  std::vector<std::string> all;
  if (lit < k_least_lit) return all;
  if (saturated > k_many)
    all.push_back(fmt::format(
        "{}: {:.0f} % of the pixels that {} lights are saturated. Shorten the exposure to half, or close the "
        "aperture.",
        camera, 100 * saturated, projector));
  else if (bright < k_dark)
    all.push_back(fmt::format(
        "{}: the light of {} only reaches grey level {:.0f} of 255. Lengthen the exposure {:.1f} times, or "
        "open the aperture.",
        camera, projector, bright, k_wanted / std::max(1.0, bright)));
  if (blur_px > k_blurred_px)
    all.push_back(
        fmt::format("{}: edges that {} projects are blurred by {:.1f} pixels. Focus the projector on the "
                    "board, then the camera.",
                    camera, projector, blur_px));
  return all;
}

ExposureReading judged_exposure(const cv::Mat& black, const cv::Mat& white, const cv::Mat& squares) {
  const cv::Mat dark = to_grey(black), bright = to_grey(white);
  cv::Mat difference;
  cv::subtract(bright, dark, difference);
  const cv::Mat lit = difference > k_lit_levels;
  ExposureReading seen;
  seen.histogram.resize(256);
  for (int y = 0; y < bright.rows; ++y)
    for (int x = 0; x < bright.cols; ++x)
      if (lit.at<std::uint8_t>(y, x)) ++seen.histogram[bright.at<std::uint8_t>(y, x)];
  const int count = cv::countNonZero(lit);
  seen.lit = static_cast<double>(count) / static_cast<double>(lit.total());
  if (count == 0) return seen;
  int above = 0;
  for (int level = 255; level >= 0; --level) {
    above += seen.histogram[static_cast<std::size_t>(level)];
    if (level == k_full) seen.saturated = static_cast<double>(above) / count;
    if (10 * above < count) continue;
    seen.bright = std::max(seen.bright, static_cast<double>(level));
  }
  seen.blur_px = blur_of(dark, bright, to_grey(squares), lit);
  return seen;
}

cv::Mat squares(int width, int height) {
  const int side = std::max(1, width / k_squares);
  cv::Mat image(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image.at<std::uint8_t>(y, x) = (x / side + y / side) % 2 == 0 ? 255 : 0;
  return image;
}

Result<std::vector<ExposureReading>> measure_exposure(const calib::CaptureSet& captures,
                                                      const calib::CaptureBackend& capture) {
  std::vector<ExposureReading> all;
  const auto grabbed = [&](int projector, const cv::Mat& image) -> Result<std::vector<cv::Mat>> {
    LIMN_TRY_STATUS(capture.show(projector, image));
    std::vector<cv::Mat> images;
    for (std::size_t i = 0; i < captures.cameras.size(); ++i) {
      LIMN_TRY(cv::Mat one, capture.grab(static_cast<int>(i)));
      images.push_back(one.clone());
    }
    return images;
  };
  for (std::size_t i = 0; i < captures.projectors.size(); ++i) {
    const calib::CapturedDevice& projector = captures.projectors[i];
    const int number = static_cast<int>(i);
    const cv::Size size(projector.width, projector.height);
    LIMN_TRY([[maybe_unused]] const auto signs,
             grabbed(number, device::output_sign(size, number + 1, projector.name)));
    LIMN_TRY(const auto black, grabbed(number, cv::Mat(size, CV_8UC1, cv::Scalar(0))));
    LIMN_TRY(const auto white, grabbed(number, cv::Mat(size, CV_8UC1, cv::Scalar(255))));
    LIMN_TRY(const auto squared, grabbed(number, squares(size.width, size.height)));
    for (std::size_t j = 0; j < captures.cameras.size(); ++j) {
      all.push_back(judged_exposure(black[j], white[j], squared[j]));
      all.back().camera = captures.cameras[j].name;
      all.back().projector = projector.name;
    }
  }
  return all;
}

std::vector<std::string> unseen(const std::vector<ExposureReading>& seen) {
  std::map<std::string, double> most;
  for (const ExposureReading& one : seen) most[one.projector] = std::max(most[one.projector], one.lit);
  std::vector<std::string> sentences;
  for (const auto& [projector, lit] : most)
    if (lit < k_least_lit)
      sentences.push_back(
          fmt::format("{}: expected its light in a camera's image, found none. Switch it on, remove its lens "
                      "cap, and point it at what the cameras see.",
                      projector));
  return sentences;
}

}  // namespace limn::wizard
