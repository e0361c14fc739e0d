#pragma once

#include <Eigen/Core>
#include <span>

#include "core/imager.h"

namespace limn::projector {

/// Near plane of all pinhole views (m). Nothing that is drawn is nearer to a lens.
constexpr double k_near = 0.01;

/// The rectangle of tangents (x/z, y/z) that a view covers.
struct TangentRect {
  Eigen::Vector2d lower = {-1, -1};
  Eigen::Vector2d upper = {1, 1};
  bool is_empty() const { return !(lower.array() < upper.array()).all(); }
};

/// The intersection of two rectangles.
TangentRect intersected(const TangentRect& a, const TangentRect& b);

/// The smallest rectangle that contains both. An empty rectangle changes nothing.
TangentRect united(const TangentRect& a, const TangentRect& b);

/// A pinhole image that is rasterised in place of an imager's distorted one, from the same position. Axes as
/// an imager's; pixel (0,0) is the centre of the top-left pixel: px = focal * (x, y) / z + centre.
struct PinholeView {
  Pose pinhole_from_scene;
  double focal = 1;
  Eigen::Vector2d centre = {0, 0};
  int width = 1;
  int height = 1;
};

/// A pinhole view that covers `rect` with a focal length of `focal` pixels, or less where it would exceed
/// max_width x max_height.
PinholeView pinhole_view_over(
    const Pose& pinhole_from_scene, const TangentRect& rect, double focal, int max_width, int max_height);

/// The tangents that points (scene frame) span. When a point is beside or behind the pinhole: everything
/// within 75 degrees of the axis.
TangentRect tangents_spanned(const Pose& pinhole_from_scene, std::span<const Eigen::Vector3d> points);

/// The matrix from the pinhole view's frame to GL's clip coordinates. This is the only place that knows GL's
/// pixel convention. GL's first row of texels is the image's top row, so no image is ever flipped. Depth is 1
/// at `k_near` and 0 at infinity.
Eigen::Matrix4d clip_from_pinhole(const PinholeView& pinhole);

}  // namespace limn::projector
