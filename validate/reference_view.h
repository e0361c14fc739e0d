#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/imager.h"
#include "sim/trace.h"
#include "sim/world.h"

namespace limn::validate {

/// The mean of each block of factor x factor pixels.
cv::Mat binned(const cv::Mat& fine, int factor);

/// The ray-traced view from a viewpoint in a virtual room: the projected light that is visible there.
struct ReferenceView {
  int finer;  ///< Rays per side of a pixel.
  sim::World world;
  sim::Samples samples;

  /// `viewer` is in the world frame and replaces the cameras of `world_in`.
  ReferenceView(const sim::World& world_in, const Imager& viewer, int rays);

  /// What is visible when these images are projected by the projectors of the world `projectors`: linear
  /// light, CV_32FC3, of the viewer's size. An empty image gives no light.
  cv::Mat rendered_light(const sim::World& projectors, const std::vector<cv::Mat>& shown) const;
  cv::Mat rendered_light(const std::vector<cv::Mat>& shown) const { return rendered_light(world, shown); }
  /// What is visible when only this projector shows its image.
  cv::Mat rendered_light(std::size_t projector, const cv::Mat& shown) const;
  /// For each projector, the share of each of the viewer's pixels that it reaches, CV_32FC1.
  std::vector<cv::Mat> reaches() const;
};

}  // namespace limn::validate
