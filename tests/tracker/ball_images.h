#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <random>
#include <span>

#include "core/lens.h"
#include "tests/tracker/marker_images.h"

namespace limn::test {

/// How a sphere reflects light.
enum class BallSurface {
  flat,  ///< the same light everywhere: retroreflective, or lit from all sides
  matt   ///< Lambert's law, with a light and some light from all sides
};

/// A sphere to be drawn.
struct PlacedBall {
  Eigen::Vector3d p_camera = Eigen::Vector3d::UnitZ();  ///< its centre
  double radius_m = 0.02;
  BallSurface surface = BallSurface::flat;
  double light = 210;  ///< grey level of a flat surface, and of a matt one that faces the light
  Eigen::Vector3d d_to_light = -Eigen::Vector3d::UnitZ();  ///< unit, camera frame
  double ambient = 0.4;                                    ///< share of `light` from all sides
};

/// The light of spheres with exact truth before blur and noise (CV_32FC1): every pixel is the mean over rays
/// through its area, which meet the nearest sphere or else see `background`.
cv::Mat light_of(const Lens& lens, const cv::Mat& background, std::span<const PlacedBall> balls);

/// The camera's image: light, blur (sigma in pixels), noise.
cv::Mat image_of(const Lens& lens,
                 const cv::Mat& background,
                 std::span<const PlacedBall> balls,
                 const ImageOptions& options,
                 std::mt19937_64& rng);

}  // namespace limn::test
