#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "core/imager.h"
#include "projector/renderer.h"
#include "scene/posed_scene.h"

namespace limn::apps {

// What is drawn over the projectors' images of the parts: values, in the order in which they are drawn. Who
// wants something drawn adds to a list; only draw() draws.

/// Left of a line on the prototype another look is shown.
struct SplitOverlay {
  scene::PosedScene left;
  double x_m = 0;  ///< of the line, in the prototype's frame
};

/// Lines on the prototype, every 10 mm.
struct GridOverlay {};

/// A ring around a marker, by one projector.
struct RingOverlay {
  std::size_t projector = 0;
  Pose world_from_marker;
  double size_m = 0;  ///< of the marker
  cv::Scalar colour;
  double strength = 1;  ///< share of full light
};

/// A word above a marker, by one projector.
struct WordOverlay {
  std::size_t projector = 0;
  Pose world_from_marker;
  double size_m = 0;
  std::string text;
  double strength = 1;
};

/// Where a sign lies on the prototype, in its frame, m: as wide as d_right is long, as high as d_down.
struct OverlayPlace {
  Eigen::Vector3d p_corner = Eigen::Vector3d::Zero();  ///< top left
  Eigen::Vector3d d_right = Eigen::Vector3d::Zero(), d_down = Eigen::Vector3d::Zero();
};

/// An image on the prototype, undistorted, or without a place in the middle of a projector's image, pixel for
/// pixel. 8-bit BGR.
struct SignOverlay {
  std::size_t projector = 0;
  cv::Mat image;
  std::optional<OverlayPlace> place;
};

using Overlay = std::variant<SplitOverlay, GridOverlay, RingOverlay, WordOverlay, SignOverlay>;

/// A projector's image of a frame, which overlays are drawn into.
struct OverlayTarget {
  std::size_t projector = 0;
  const Imager& imager;
  const scene::PosedScene& posed;
  cv::Mat* image;
  /// For split and grid, which depend on the surface: the renderer that drew the image, and whose eye it was
  /// drawn for. Null: they are left out.
  projector::Renderer* renderer = nullptr;
  const Imager* viewer = nullptr;
};

/// Draws those that are this projector's.
void draw(std::span<const Overlay> overlays, const OverlayTarget& target);

/// Draws a sign into a projector's image so that it lies there undistorted. Nothing is drawn where a corner
/// is not in the projector's view.
void draw_pairing_overlay(const cv::Mat& sign,
                          const OverlayPlace& place,
                          const Imager& projector,
                          const Pose& world_from_prototype,
                          cv::Mat* image);

}  // namespace limn::apps
