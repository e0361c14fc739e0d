#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/imager.h"
#include "scene/mesh.h"
#include "sim/world.h"

namespace limn::apps {

/// Small white discs to be projected, each aimed at a point of the prototype's surface. Prototype frame.
struct AimedDots {
  scene::Mesh mesh;                      ///< unlit
  std::vector<Eigen::Vector3d> p_aimed;  ///< where the middle of each disc's light is to land
  double spacing_m = 0;                  ///< p_aimed are at least this far apart

  // Of discs that float before the surface, else empty: their centres and the eye that sees each before its
  // p_aimed.
  std::vector<Eigen::Vector3d> p_centres;
  Eigen::Vector3d p_eye = Eigen::Vector3d::Zero();
};

/// About `count` random points on the prototype with a disc on each. Only points that some true projector
/// reaches with its whole disc, well inside its image.
AimedDots aimed_dots(const sim::World& world, int count, std::uint64_t seed);

/// About `count` discs that float `height_m` off random points of the prototype and face the viewer's eye,
/// which sees them before points that some true projector reaches.
AimedDots floating_dots(
    const sim::World& world, const Imager& viewer, double height_m, int count, std::uint64_t seed);

/// How far light lands from where it was aimed: on the surface; of floating discs as the eye sees it, in each
/// disc's plane.
struct Registration {
  double rms_mm = 0;
  double p95_mm = 0;
  int points = 0;
  int unlit = 0;  ///< of them, dots that got no light: counted with the largest distance looked at
  std::vector<double> errors_mm;  ///< per dot
};

/// Shines the projectors' 8-bit images (true gamma) through the true rig onto the true prototype, pixel by
/// pixel, and compares the centroid of each dot's light with the point it was aimed at.
Registration judged_registration(const sim::World& world,
                                 const AimedDots& dots,
                                 std::span<const cv::Mat> projector_images);

/// RMS distance in pixels between the outlines of two masks (non-zero is inside), both ways; outlines along
/// the image's border do not count. Infinite when one of them is empty.
double outline_distance_px(const cv::Mat& found, const cv::Mat& truth);

/// Intersection over union of two labelled images: pixels where both have the same label other than 0, over
/// pixels where either has one.
double label_iou(const cv::Mat& found, const cv::Mat& truth);

/// The largest difference of any level between two series of 8-bit images; infinite when their number or
/// sizes differ.
double worst_difference(std::span<const cv::Mat> a, std::span<const cv::Mat> b);

}  // namespace limn::apps
