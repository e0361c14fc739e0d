#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/enum_names.h"
#include "core/lens.h"
#include "tracker/balls/ball.h"
#include "tracker/balls/ball_fit.h"
#include "tracker/contours.h"
#include "tracker/fork_join.h"
#include "tracker/threshold.h"

namespace limn::tracker {

/// Which spheres are searched for.
enum class BallShade {
  bright,  ///< brighter than what is around them: ping-pong balls, retroreflective ones
  dark,
  any
};
/// Their names for users.
inline constexpr EnumNames<BallShade, 3> k_ball_shades{{"bright", "dark", "any"}};

struct BallFinderOptions {
  BallShade shade = BallShade::bright;
  double min_diameter_px = 8;  ///< smaller outlines are ignored; below 8 px round dirt looks like a sphere
  double max_diameter_px = 400;
  int min_contrast = 20;  ///< smallest difference between the sphere and its surroundings, of 255
  Encoding encoding = Encoding::linear;
};

/// Finds plain spheres: local threshold -> boundaries -> those whose rays form a cone -> fit of the shaded
/// sphere. Where a boundary is no cone, arcs of it that lie on cones start fits of what is not hidden: of
/// spheres that something covers up to two fifths of the outline, and of spheres that touch in the image.
/// Each is found once. Holds its buffers, so use one for each thread.
class BallFinder {
 public:
  explicit BallFinder(BallFinderOptions options = {});

  /// The spheres in a camera's raw image (8-bit, one channel), largest contrast first. An empty image has
  /// none.
  std::vector<Ball> find(const cv::Mat& grey, const Lens& lens);

 private:
  BallFinderOptions options_;
  Threshold threshold_;
  CornerCodes corners_;
  Contours contours_;
  BallFitter fitter_;
  cv::Mat inverted_;
  std::vector<Eigen::Vector2d> flat_;  // a boundary's points in a plane in which outlines are circles
  std::vector<Eigen::Vector3d> d_;     // directions of a boundary's points

  void find_in(const cv::Mat& dark_balls, const cv::Mat& grey, const Lens& lens, std::vector<Ball>* balls);
  std::optional<BallOutline> outline(const Contours::Extent& extent, const Lens& lens);
  std::vector<BallOutline> partial_outlines(const Contours::Extent& extent, const Lens& lens);
  void add(const BallOutline& start,
           bool is_dark,
           const cv::Mat& grey,
           const Lens& lens,
           std::vector<Ball>* balls);
};

}  // namespace limn::tracker
