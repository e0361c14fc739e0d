#pragma once

#include <Eigen/Core>
#include <span>

#include "core/imager.h"

namespace limn::projector {

/// Metres; the nearest that a twin sees: nothing is lit or worn nearer to a lens.
constexpr double k_near = 0.01;

/// A rectangle of tangents (x/z, y/z) that a view covers.
struct TangentRect {
  Eigen::Vector2d lower = {-1, -1};
  Eigen::Vector2d upper = {1, 1};
  bool is_empty() const { return !(lower.array() < upper.array()).all(); }
};

/// The part of both.
TangentRect intersected(const TangentRect& a, const TangentRect& b);

/// The least that holds both; of none is spanned() of no points.
TangentRect united(const TangentRect& a, const TangentRect& b);

/// A pinhole image rasterised in place of an imager's distorted one; whose eye it has. Frame as an
/// imager's; pixel (0,0) is the centre of the top-left pixel: px = focal * (x, y) / z + centre.
struct PinholeView {
  Pose pinhole_from_scene;
  double focal = 1;
  Eigen::Vector2d centre = {0, 0};
  int width = 1;
  int height = 1;
};

/// A twin over `rect` with `focal` pixels a tangent, coarser where it would exceed max_width x max_height.
PinholeView pinhole_view_over(
    const Pose& pinhole_from_scene, const TangentRect& rect, double focal, int max_width, int max_height);

/// The tangents that points (scene frame) span; everything within 75 degrees when one is beside or behind the
/// eye.
TangentRect tangents_spanned(const Pose& pinhole_from_scene, std::span<const Eigen::Vector3d> points);

/// GL's clip coordinates of a point in the twin's frame: the only place that knows GL's pixel convention. Its
/// first row of texels is our top row, so nothing is ever flipped; depth is 1 at `k_near` and 0 at infinity.
Eigen::Matrix4d clip_from_pinhole(const PinholeView& pinhole);

}  // namespace limn::projector
