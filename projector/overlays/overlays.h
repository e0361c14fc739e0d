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

namespace limn::projector {

// Overlays are drawn over the projectors' images of the parts. They are values in a list, in drawing order;
// only draw() draws them.

/// Shows another look left of a line on the prototype.
struct SplitOverlay {
  scene::PosedScene left;
  double x_m = 0;  ///< x of the line in the prototype's frame
};

/// Lines on the prototype, every 10 mm.
struct GridOverlay {};

/// A ring around a marker, drawn by one projector.
struct RingOverlay {
  std::size_t projector = 0;
  Pose world_from_marker;
  double size_m = 0;  ///< the marker's side
  cv::Scalar colour;
  double strength = 1;  ///< share of the full display value
};

/// A word above a marker, drawn by one projector.
struct WordOverlay {
  std::size_t projector = 0;
  Pose world_from_marker;
  double size_m = 0;
  std::string text;
  double strength = 1;
};

/// The rectangle of a sign on the prototype, in the prototype's frame, m. d_right and d_down are its full
/// width and height, not unit vectors.
struct OverlayPlace {
  Eigen::Vector3d p_corner = Eigen::Vector3d::Zero();  ///< top left
  Eigen::Vector3d d_right = Eigen::Vector3d::Zero(), d_down = Eigen::Vector3d::Zero();
};

/// An 8-bit BGR image. With a place, it appears there undistorted on the prototype; without one, it is copied
/// pixel by pixel into the middle of the projector's image.
struct SignOverlay {
  std::size_t projector = 0;
  cv::Mat image;
  std::optional<OverlayPlace> place;
};

using Overlay = std::variant<SplitOverlay, GridOverlay, RingOverlay, WordOverlay, SignOverlay>;

/// A projector's image that overlays are drawn into.
struct OverlayTarget {
  std::size_t projector = 0;
  const Imager& imager;
  const scene::PosedScene& posed;
  cv::Mat* image = nullptr;
  /// Split and grid depend on the surface: they need the renderer that drew the image, and the viewer for
  /// whom it was drawn. Null: they are left out.
  Renderer* renderer = nullptr;
  const Imager* viewer = nullptr;
};

/// Draws the overlays that belong to this projector.
void draw(std::span<const Overlay> overlays, const OverlayTarget& target);

/// Draws a sign into a projector's image so that it appears undistorted at its place. Draws nothing if a
/// corner cannot be projected.
void draw_pairing_overlay(const cv::Mat& sign,
                          const OverlayPlace& place,
                          const Imager& projector,
                          const Pose& world_from_prototype,
                          cv::Mat* image);

}  // namespace limn::projector
