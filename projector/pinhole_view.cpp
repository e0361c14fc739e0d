#include "projector/pinhole_view.h"

#include <algorithm>
#include <cmath>

namespace limn::projector {
namespace {

// 75 degrees; a wider pinhole image would spend most of its pixels on the border.
constexpr double k_widest_tangent = 3.7;

}  // namespace

TangentRect intersected(const TangentRect& a, const TangentRect& b) {
  return {a.lower.cwiseMax(b.lower), a.upper.cwiseMin(b.upper)};
}

TangentRect united(const TangentRect& a, const TangentRect& b) {
  return {a.lower.cwiseMin(b.lower), a.upper.cwiseMax(b.upper)};
}

PinholeView pinhole_view_over(
    const Pose& pinhole_from_scene, const TangentRect& rect, double focal, int max_width, int max_height) {
  PinholeView pinhole;
  pinhole.pinhole_from_scene = pinhole_from_scene;
  if (rect.is_empty()) return pinhole;
  constexpr double k_margin = 2;  // texels around the image, so that texels at the border have neighbours
  const Eigen::Vector2d extent = rect.upper - rect.lower;
  pinhole.focal =
      std::min({focal, (max_width - 2 * k_margin) / extent.x(), (max_height - 2 * k_margin) / extent.y()});
  pinhole.width = std::min(max_width, static_cast<int>(std::ceil(pinhole.focal * extent.x() + 2 * k_margin)));
  pinhole.height =
      std::min(max_height, static_cast<int>(std::ceil(pinhole.focal * extent.y() + 2 * k_margin)));
  pinhole.centre = Eigen::Vector2d::Constant(k_margin - 0.5) - pinhole.focal * rect.lower;
  return pinhole;
}

TangentRect tangents_spanned(const Pose& pinhole_from_scene, std::span<const Eigen::Vector3d> points) {
  const Eigen::Vector2d widest = Eigen::Vector2d::Constant(k_widest_tangent);
  TangentRect rect{widest, -widest};
  for (const Eigen::Vector3d& p_scene : points) {
    const Eigen::Vector3d p = pinhole_from_scene * p_scene;
    if (p.z() < 2 * k_near) return {-widest, widest};
    const Eigen::Vector2d tangent = p.head<2>() / p.z();
    rect.lower = rect.lower.cwiseMin(tangent);
    rect.upper = rect.upper.cwiseMax(tangent);
  }
  rect.lower = rect.lower.cwiseMax(-widest);
  rect.upper = rect.upper.cwiseMin(widest);
  return rect;
}

Eigen::Matrix4d clip_from_pinhole(const PinholeView& pinhole) {
  // GL's window coordinate of a pixel centre is the pixel's index plus one half.
  Eigen::Matrix4d clip = Eigen::Matrix4d::Zero();
  clip(0, 0) = 2 * pinhole.focal / pinhole.width;
  clip(0, 2) = 2 * (pinhole.centre.x() + 0.5) / pinhole.width - 1;
  clip(1, 1) = 2 * pinhole.focal / pinhole.height;
  clip(1, 2) = 2 * (pinhole.centre.y() + 0.5) / pinhole.height - 1;
  clip(2, 3) = k_near;
  clip(3, 2) = 1;
  return clip;
}

}  // namespace limn::projector
