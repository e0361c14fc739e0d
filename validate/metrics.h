#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/imager.h"
#include "scene/meshes/mesh.h"
#include "sim/world.h"

namespace limn::validate {

/// Small white discs to be projected, each aimed at a point of the prototype's surface. Prototype frame.
struct TargetDots {
  scene::Mesh mesh;                        ///< The discs, unlit material.
  std::vector<Eigen::Vector3d> p_targets;  ///< Where the centre of each disc's light should land.
  double spacing_m = 0;                    ///< Smallest distance between the points p_targets.

  // For discs that float in front of the surface, else empty: their centres, and the viewpoint from which
  // each disc covers its p_targets.
  std::vector<Eigen::Vector3d> p_centres;
  Eigen::Vector3d p_viewpoint = Eigen::Vector3d::Zero();
};

/// About `count` random points on the prototype, each with a disc. Uses only points at which some true
/// projector reaches the whole disc, well inside its image.
TargetDots target_dots(const sim::World& world, int count, std::uint64_t seed);

/// About `count` discs that float `height_m` off random points of the prototype and face the viewpoint. Seen
/// from there, each covers a point that some true projector reaches.
TargetDots floating_dots(
    const sim::World& world, const Imager& viewer, double height_m, int count, std::uint64_t seed);

/// The distance of light from where it was aimed: on the surface, or for floating discs in each disc's plane
/// as seen from the viewpoint.
struct Registration {
  double rms_mm = 0;
  double p95_mm = 0;
  int points = 0;
  int unlit = 0;  ///< Dots without any light, also counted in `points`; their error is the search radius.
  std::vector<double> errors_mm;  ///< One for each dot.
};

/// Projects the 8-bit images (true gamma) through the true rig onto the true prototype, pixel by pixel, and
/// compares the centroid of each dot's light with the point that it was aimed at.
Registration judged_registration(const sim::World& world,
                                 const TargetDots& dots,
                                 std::span<const cv::Mat> projector_images);

/// RMS distance in pixels between the outlines of two masks (non-zero is inside), in both directions.
/// Outlines along the image's border do not count. Infinite when a mask is empty.
double outline_distance_px(const cv::Mat& found, const cv::Mat& truth);

/// Intersection over union of two labelled images: the number of pixels where both have the same label other
/// than 0, divided by the number of pixels where either has a label.
double label_iou(const cv::Mat& found, const cv::Mat& truth);

/// The largest difference of any level between two series of 8-bit images; infinite when their number or
/// sizes differ.
double worst_difference(std::span<const cv::Mat> a, std::span<const cv::Mat> b);

}  // namespace limn::validate
