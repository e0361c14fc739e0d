#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>

#include "tracker/pattern_fit.h"

namespace limn::tracker {

/// By how much black has drawn back at every edge between it and white, pixels: overexposed paper, a camera's
/// sharpening, levels that are no light, ink that has not run. Negative where it has spread. It moves all
/// four sides of a marker inwards alike, which no residual of them shows.
struct EdgeBleed {
  double px = 0;
  double variance = 0;  ///< px^2
};

/// From the edges of a code's cells, which the marker's sides alone say nothing about: between the middles of
/// two neighbours, black and white, light rises by half in the middle of the way, however symmetrically it is
/// blurred. `corners_px` are those of the quad that showed the `cells`, `light` that of a grey level
/// (EdgeRefiner::light). nullopt where there are too few such edges. Cells should be wider than five sigmas
/// of the blur.
std::optional<EdgeBleed> find_edge_bleed(const cv::Mat& grey,
                                         const std::array<double, 256>& light,
                                         const std::array<Eigen::Vector2d, 4>& corners_px,
                                         const SeenCells& cells);

/// What the markers of one image say together, whose variance counts their disagreement; nullopt of none.
std::optional<EdgeBleed> common_edge_bleed(std::span<const EdgeBleed> of_markers);

/// Moves a marker's sides out by what is sure of the retreat: all of what shows clearly, nothing of what
/// noise makes as large once in 370 times. Adds to the covariances what is not sure.
void undo_edge_bleed(const EdgeBleed& bleed,
                     std::array<Eigen::Vector2d, 4>* corners_px,
                     std::array<Eigen::Matrix2d, 4>* covariance);

}  // namespace limn::tracker
