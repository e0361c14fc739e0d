#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "core/lens.h"
#include "tracker/pattern_appearance.h"
#include "tracker/refine.h"

namespace limn::tracker {

/// Memory of fit_pattern, kept between calls.
struct PatternFitBuffers {
  struct Samples {
    std::vector<float> x, y;  ///< pixels from the marker's middle
    /// Marker coordinates at the fit's start, -1 to 1, for the planes of levels.
    std::vector<float> level_x, level_y;
    std::vector<float> light;
  };
  Samples samples;
  std::vector<std::int32_t> keeps;  ///< one for each sample
  std::vector<float> residuals, sizes, behind;
  std::vector<float> roots, pulls;  ///< roots of the weights; residuals times roots
  std::vector<float> derivatives;   ///< one unknown after the other, later times the weight's root
  std::vector<float> unused;        ///< derivatives by unknowns that are not fitted
};

/// A quad fitted by its whole pattern. The fit does not set the age in `seen`.
struct FittedPattern {
  std::array<Eigen::Vector2d, 4> corners_px;
  std::array<Eigen::Matrix2d, 4> corner_covariance;
  PatternAppearance seen;
};

/// Refines a quad with a known code where edges lie too close together for EdgeRefiner: with strong blur or
/// motion, small or steep cells, or white margins of a pixel. The model is a homography's image of the black
/// border, cells, white margin and background, blurred by one Gaussian and by uniform straight motion, in
/// light that changes linearly over the marker, with bent paper where the residuals need it. Motions in
/// several directions are tried and the best one is refined. The covariance comes from the residuals and
/// accounts for correlation between neighbouring ones. nullopt when the pixels do not determine the fit or
/// contradict the model. `light` is the light of each grey level. With a `lens`, sides are straight as in
/// EdgeRefiner. The previous content of `buffers` does not matter.
std::optional<FittedPattern> fit_pattern(const cv::Mat& grey,
                                         const std::array<double, 256>& light,
                                         const RefinedQuad& start,
                                         const SeenCells& cells,
                                         const Lens* lens,
                                         PatternFitBuffers* buffers);

/// Fits the same pattern in another image near `corners_px`, in a tenth of the time, because the known
/// appearance is almost right already. Also nullopt when the appearance has changed: light or blur differ,
/// something covers the marker, or it is another marker.
std::optional<FittedPattern> follow_pattern(const cv::Mat& grey,
                                            const std::array<double, 256>& light,
                                            const std::array<Eigen::Vector2d, 4>& corners_px,
                                            const PatternAppearance& known,
                                            const Lens* lens,
                                            PatternFitBuffers* buffers);

}  // namespace limn::tracker
