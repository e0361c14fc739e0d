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

/// The memory of fit_pattern, kept between calls.
struct PatternFitBuffers {
  struct Samples {
    std::vector<float> x, y;              ///< pixels from the marker's middle
    std::vector<float> level_x, level_y;  ///< -1 to 1 over the marker at first, of the levels' planes
    std::vector<float> light;
  };
  Samples samples;
  std::vector<std::int32_t> keeps;  ///< of each sample
  std::vector<float> residuals, sizes, behind;
  std::vector<float> roots, pulls;  ///< of the weights; residuals times these
  std::vector<float> derivatives;   ///< one unknown's after the other's, then times the weight's root
  std::vector<float> unused;        ///< derivatives by what takes no part
};

/// A quad by its whole pattern; of `seen` the fit knows no age.
struct FittedPattern {
  std::array<Eigen::Vector2d, 4> corners_px;
  std::array<Eigen::Matrix2d, 4> corner_covariance;
  PatternAppearance seen;
};

/// Refines a quad whose code is known where edges lie too near to each other for EdgeRefiner: blur wider than
/// the cells leave room for, motion, small or steep cells, white margins of a pixel. The marker's pixels are
/// fitted as what they are: a homography's image of black border, cells, white margin and what lies behind,
/// seen through one Gaussian and an even straight motion, in light that changes linearly over the marker;
/// bent paper where the residuals ask for it. Motions in several directions compete before the best is
/// refined. The covariance comes from the residuals, with neighbouring ones that have one cause counted as
/// one. nullopt when the pixels do not settle it or contradict the model. `light` is the light of a grey
/// level; with a `lens` sides are straight as EdgeRefiner's are; what `buffers` hold from other calls makes
/// no difference.
std::optional<FittedPattern> fit_pattern(const cv::Mat& grey,
                                         const std::array<double, 256>& light,
                                         const RefinedQuad& start,
                                         const SeenCells& cells,
                                         const Lens* lens,
                                         PatternFitBuffers* buffers);

/// The same pattern in another image, at about `corners_px`, in a tenth of the time: the look it had is all
/// but right there. nullopt also when it does not look like that any more: light or blur have changed,
/// something lies over it, it is another marker.
std::optional<FittedPattern> follow_pattern(const cv::Mat& grey,
                                            const std::array<double, 256>& light,
                                            const std::array<Eigen::Vector2d, 4>& corners_px,
                                            const PatternAppearance& known,
                                            const Lens* lens,
                                            PatternFitBuffers* buffers);

}  // namespace limn::tracker
