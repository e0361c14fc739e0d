#include "tracker/marker_image.h"

#include "tracker/family.h"

namespace limn::tracker {

Result<MarkerDrawing> marker_image(const MarkerName& marker) {
  constexpr int k_pixels_per_cell = 8;  // any number draws the same edges, because cells are uniform
  return draw_whole_marker(marker, k_pixels_per_cell);
}

}  // namespace limn::tracker
