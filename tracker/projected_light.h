#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <span>

#include "core/imager.h"

namespace limn::tracker {

/// A flat thing of known place: z = 0 of its frame, facing -z (as a marker), within `half_size` of its
/// origin.
struct Plate {
  Pose world_from_plate;
  Eigen::Vector2d half_size = {0, 0};  ///< m
};

/// Camera pixels between those whose light is worked out; light changes its place slowly.
constexpr int k_light_step = 4;

/// Where a camera's rays meet plates: CV_32FC3 in the world (m), NaN where none, of every k_light_step-th
/// pixel. `behind`, of the same size (empty: nothing), is what is seen beside them, such as the prototype's
/// surface.
cv::Mat points_seen(const Imager& camera, std::span<const Plate> plates, const cv::Mat& behind = {});

/// What a projector shines, as linear light per pixel: CV_32FC1, share of full white.
struct ShownLight {
  const Imager* projector = nullptr;
  cv::Mat light;
};

/// The light that projectors throw on what each camera pixel sees, CV_32FC1 of the camera's size, in units of
/// full white at 1 m head on: through both lenses, with distance and incidence; 0 where the points are
/// unknown, turned away or beside the projectors' images. Shadows are not known. `points` is as points_seen
/// gives it. `blur_px` is what pixels' areas and lenses make of a sharp edge (standard deviation): too small,
/// edges of the light stay as bright lines.
cv::Mat light_seen(const Imager& camera,
                   const cv::Mat& points,
                   std::span<const ShownLight> shown,
                   double blur_px = 0.7);

/// An image with the projected light divided out, for the detector: what the camera would see if the
/// projectors shone evenly.
struct Discounted {
  cv::Mat grey;     ///< 8-bit; the image itself when the light explains none of its gradients
  double gain = 0;  ///< of full white at 1 m over the room's light
};

/// `grey` (8-bit, one channel, proportional to light above `black_level`) is taken for reflectance x (room +
/// gain x light); the gain is the one that explains most of the image's gradients (least sum of absolute
/// differences of logarithms), so neither exposure nor room light need be known.
Discounted discounted(const cv::Mat& grey, const cv::Mat& light, double black_level = 0);

}  // namespace limn::tracker
