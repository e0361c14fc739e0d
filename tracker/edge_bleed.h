#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>

#include "tracker/pattern_fit.h"

namespace limn::tracker {

/// By how many pixels black has drawn back at every edge to white. Causes are overexposed paper, a camera's
/// sharpening, grey levels that are not linear light, and printing. It is negative where black has spread. It
/// moves all four sides of a marker inwards alike, so the sides' residuals do not show it.
struct EdgeBleed {
  double px = 0;
  double variance = 0;  ///< px^2
};

/// Measures the bleed at the edges of a code's cells. On the way from the middle of a black cell to the
/// middle of a white neighbour, light rises by half at the midpoint, for any symmetric blur. `corners_px` are
/// the corners of the quad that showed the `cells`; `light` is the light of each grey level
/// (EdgeRefiner::light). nullopt where there are too few such edges. Cells should be wider than five sigmas
/// of the blur.
std::optional<EdgeBleed> find_edge_bleed(const cv::Mat& grey,
                                         const std::array<double, 256>& light,
                                         const std::array<Eigen::Vector2d, 4>& corners_px,
                                         const SeenCells& cells);

/// Weighted mean over the markers of one image; its variance includes their disagreement. nullopt when there
/// are none.
std::optional<EdgeBleed> common_edge_bleed(std::span<const EdgeBleed> of_markers);

/// Moves a marker's sides out by the certain part of the bleed: by all of it where it shows clearly, by
/// nothing where noise makes a bleed as large once in 370 times. Adds the uncertain part to the covariances.
void undo_edge_bleed(const EdgeBleed& bleed,
                     std::array<Eigen::Vector2d, 4>* corners_px,
                     std::array<Eigen::Matrix2d, 4>* covariance);

}  // namespace limn::tracker
