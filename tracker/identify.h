#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "tracker/family.h"
#include "tracker/refine.h"

namespace limn::tracker {

/// What a quad's inside says.
struct Identity {
  MarkerName marker;
  std::size_t first_corner = 0;  ///< which of the quad's corners is the marker's own top left
  double score = 0;              ///< as Detection::score
};

/// Reads the quad's cells through its homography and compares them with every family; the best that is clear
/// enough. The limit between black and white comes from the levels beside the four edges, as a plane over the
/// marker, so that a gradient of light does no harm.
std::optional<Identity> identify(const cv::Mat& grey, const RefinedQuad& quad, const Families& families);

}  // namespace limn::tracker
