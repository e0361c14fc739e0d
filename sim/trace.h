#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "sim/world.h"

namespace limn::sim {

/// How a projector sees one sample: everything that its light needs apart from the picture shown.
struct ProjectorView {
  float u = 0, v = 0;  ///< pixel, through the true lens
  float visible = 0;   ///< share of the sample that the projector reaches, 0..1 (shadow rays, facing)
  float cosine = 0;    ///< of the angle of incidence
  float distance = 1;  ///< from the projector's centre, m
  float depth = 1;     ///< along its axis, m
};

/// What a camera's pixels see, traced once per geometry; showing another picture is a lookup. Sample i <
/// width * height is the first of pixel i; further samples of pixels on edges follow, sorted by pixel. Arrays
/// run in parallel.
struct Samples {
  int camera = 0;
  int width = 0;
  int height = 0;
  std::vector<std::int32_t> pixel;                     ///< row * width + column
  std::vector<float> weight;                           ///< share of the pixel; those of one pixel sum to 1
  std::vector<std::int16_t> object;                    ///< index into World::objects; -1: nothing was hit
  std::vector<Eigen::Vector3f> p_world;                ///< mean hit point
  std::vector<Eigen::Vector3f> n_world;                ///< unit normal towards the camera
  std::vector<Eigen::Vector3f> albedo;                 ///< linear BGR
  std::vector<float> grey_albedo;                      ///< their mean, what a grey camera sees
  std::vector<float> room_light;                       ///< illuminance by the room
  std::vector<std::vector<ProjectorView>> projectors;  ///< per projector
  std::size_t size() const { return pixel.size(); }
};

/// Traces the pixels of a camera. Pixels on silhouettes, texture edges and shadow edges get 32 sub-samples,
/// merged where they agree. Surfaces are diffuse; light bounces once.
Samples trace(const World& world, int camera);

/// Linear light in every pixel (CV_32FC1, or C3 for a colour camera): no blur, no noise, no exposure. `shown`
/// holds one 8-bit grey or BGR picture per projector; an empty picture is black, an empty span is all black.
/// A projector's pixels are little squares, blurred by defocus where the surface is out of focus.
cv::Mat ideal_light(const World& world, const Samples& samples, std::span<const cv::Mat> shown);

/// After the lens: PSF, vignetting, exposure. Linear, 1 is full scale; may exceed it.
cv::Mat exposed(const World& world, int camera, const cv::Mat& light);

/// After the sensor: shot and read noise, encoding, black level, 8 bits. The same seed gives the same bytes.
cv::Mat digitised(const World& world, int camera, const cv::Mat& signal, std::uint64_t seed);

/// All three steps. Throws std::logic_error when `shown` does not fit the projectors.
cv::Mat photograph(const World& world,
                   const Samples& samples,
                   std::span<const cv::Mat> shown,
                   std::uint64_t seed);

}  // namespace limn::sim
