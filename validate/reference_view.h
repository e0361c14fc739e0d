#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/imager.h"
#include "sim/trace.h"
#include "sim/world.h"

namespace limn::apps {

/// The mean of each factor x factor pixels.
cv::Mat binned(const cv::Mat& fine, int factor);

/// A viewer's eye in a virtual room, ray traced: the light that it sees of what projectors shine.
struct ReferenceView {
  int finer;  ///< rays a side of a pixel
  sim::World world;
  sim::Samples samples;

  /// `viewer` stands in the world frame and takes the place of the stage's cameras.
  ReferenceView(const sim::World& stage, const Imager& viewer, int rays);

  /// With these images shone by the projectors as `projectors` has them: linear light, CV_32FC3, of the
  /// viewer's size. An empty image is no light.
  cv::Mat seen(const sim::World& projectors, const std::vector<cv::Mat>& shown) const;
  cv::Mat seen(const std::vector<cv::Mat>& shown) const { return seen(world, shown); }
  /// With the image of one projector alone.
  cv::Mat seen(std::size_t projector, const cv::Mat& shown) const;
  /// Share of each of the viewer's pixels that each projector reaches, CV_32FC1.
  std::vector<cv::Mat> reaches() const;
};

}  // namespace limn::apps
