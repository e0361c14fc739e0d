#pragma once

#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "calib/surface/deviation.h"

namespace limn::calib {

/// An image of the CAD in the colours of its deviation, for people.
struct DeviationView {
  std::string from;  ///< "+x +z": the side that is seen, in the prototype's frame.
  cv::Mat image;     ///< 8-bit BGR.
};

/// Images of the CAD from the sides that show the most of what was measured, at most four. Every pixel has
/// the colour of the deviation there (deviation_scale.h), uncertain places are hatched, and what was not
/// measured is grey. Each extreme is marked by its number, from 1, and its mm where it is visible.
std::vector<DeviationView> deviation_views(const Deviation& deviation,
                                           std::span<const DeviationExtreme> extremes,
                                           int width,
                                           int height);

}  // namespace limn::calib
