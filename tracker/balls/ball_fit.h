#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "core/lens.h"
#include "tracker/balls/ball.h"
#include "tracker/balls/ball_arcs.h"
#include "tracker/refine.h"

namespace limn::tracker {

/// A sphere's outline, good to about a pixel.
struct BallOutline {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  ///< pixel of the sphere's centre
  double radius_px = 0;
  OutlineParts shown = OutlineParts().set();  ///< nothing hides these, and nothing else lies beside them
};

/// Fits the image of a shaded sphere to the pixels around its outline: background outside; inside, light that
/// varies slowly around the outline, and the part of a matt surface's light that falls towards the limb as
/// the cosine of the angle to the viewing ray; both blurred by a Gaussian. The outline is the cone of
/// directions that touch the sphere, through the lens. Holds its buffers between calls.
class BallFitter {
 public:
  /// As for EdgeRefiner: positions are computed in linear light.
  explicit BallFitter(Encoding encoding = Encoding::linear);

  /// Only the pixels at the outline's shown parts are used; they must be at least 7 sixteenths of it, and
  /// those that something beside the outline disturbs are left out, too. nullopt when the pixels do not show
  /// a sphere's outline of at least `min_contrast` (of 255) near `start`: the outline is not a cone, it has
  /// no edge on much of its length, or it leaves the image.
  std::optional<Ball> fit(const cv::Mat& grey,
                          const Lens& lens,
                          const BallOutline& start,
                          double min_contrast);

 private:
  struct Pixel {
    Eigen::Vector3d d;     // unit direction
    PixelByPoint px_by_d;  // derivative of the lens there
    Eigen::Vector2d px;
    double light;
  };
  struct State;
  struct Problem;
  EdgeRefiner encoding_;  // for its table of light
  std::vector<Pixel> pixels_;

  // Fits the shown parts; says which of them nothing disturbs.
  std::optional<Ball> fit_shown(const cv::Mat& grey,
                                const Lens& lens,
                                const BallOutline& start,
                                double min_contrast,
                                OutlineParts* undisturbed_parts);
  bool collect(const cv::Mat& grey, const Lens& lens, const State& state, const OutlineParts& shown);
};

}  // namespace limn::tracker
