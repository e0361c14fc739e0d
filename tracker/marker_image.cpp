#include "tracker/marker_image.h"

#include "tracker/family.h"

namespace limn::tracker {

Result<cv::Mat> marker_image(const MarkerName& marker) {
  constexpr int k_pixels_per_cell = 8;  // any number draws the same edges, because cells are uniform
  return tracker::draw_marker(marker, k_pixels_per_cell);
}

}  // namespace limn::tracker
