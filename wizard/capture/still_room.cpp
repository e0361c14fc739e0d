#include "wizard/capture/still_room.h"

#include <opencv2/imgproc.hpp>

#include "core/image_io.h"

namespace limn::wizard {
namespace {

constexpr int k_width = 160;       // width of the small image, in which noise of single pixels averages out
constexpr double k_levels = 8;     // on the scale of 255; larger changes are not noise
constexpr double k_share = 0.002;  // share of the image; a hand at its edge changes more

}  // namespace

bool StillRoom::add_image(const cv::Mat& image, Stamp at) {
  cv::Mat small;
  cv::resize(to_grey(image), small, {k_width, std::max(1, k_width * image.rows / image.cols)}, 0, 0,
             cv::INTER_AREA);
  cv::Mat differs;
  if (small.size() == still_.size()) cv::absdiff(small, still_, differs);
  const bool is_moving =
      differs.empty() || cv::countNonZero(differs > k_levels) > k_share * static_cast<double>(small.total());
  if (is_moving) {
    still_ = small;
    since_ = at;
  }
  return seconds_between(since_, at) >= k_rest_s;
}

}  // namespace limn::wizard
