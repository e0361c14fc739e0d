#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>

#include "sim/trace.h"
#include "sim/world.h"

namespace limn::sim {

/// The light of a display value (0 … 1) as a share of full white, including the black level; channel 0 is
/// blue, 1 green, 2 red.
double light_share(const ProjectorEffects& effects, int channel, double value);

/// Linear light in every pixel (CV_32FC1, or C3 for a colour camera): no blur, no noise, no exposure. `shown`
/// holds one 8-bit grey or BGR image per projector; an empty image is black, an empty span is all black.
/// A CV_32FC3 image is the linear light that leaves the projector, as a share of full white: no gamma or
/// black level is applied. A projector's pixels are small squares, blurred where the surface is out of focus.
cv::Mat ideal_light(const World& world, const Samples& samples, std::span<const cv::Mat> shown);

/// How a frame differs from an undisturbed one: the image is displaced, all its light has a factor.
struct Disturbance {
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  double gain = 1;
};
/// The disturbance of the frame with that seed, from the camera's shake and flicker. The same seed gives the
/// same disturbance.
Disturbance disturbance(const World& world, int camera, std::uint64_t seed);

/// The signal after lens and exposure: disturbance, PSF, vignetting, exposure. Linear; 1 is full scale and
/// may be exceeded.
cv::Mat exposed(const World& world, int camera, const cv::Mat& light, const Disturbance& disturbance = {});

/// The frame after the sensor: shot and read noise, encoding, black level, 8 bits. The same seed gives the
/// same bytes.
cv::Mat digitised(const World& world, int camera, const cv::Mat& signal, std::uint64_t seed);

/// All three steps. Throws std::logic_error when `shown` does not fit the projectors.
cv::Mat photograph(const World& world,
                   const Samples& samples,
                   std::span<const cv::Mat> shown,
                   std::uint64_t seed);

}  // namespace limn::sim
