#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "core/lens.h"
#include "core/pose.h"

namespace limn {

/// Pixels: no image's side is longer; the largest that GL 4.5 must hold.
inline constexpr int k_max_side = 16384;

/// A half-line: origin (m) and unit direction.
struct Ray {
  Eigen::Vector3d p_origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d d = Eigen::Vector3d::UnitZ();
};

/// A camera or a projector: the geometry is one type, the light only runs the other way.
/// Frame: x right, y down, z forward; pixel (0,0) is the centre of the top-left pixel.
struct Imager {
  std::string name;
  int width = 0;
  int height = 0;
  Lens lens;
  Pose imager_from_world;

  /// Pixel of a world point, also when outside the image; nullopt when it has none (behind).
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_world) const;
  /// Ray of a pixel in the world.
  std::optional<Ray> ray(const Eigen::Vector2d& px) const;
  /// Whether px lies on the image, its outer pixels' areas included.
  bool contains(const Eigen::Vector2d& px) const;
};

/// The same imager read out at another resolution of the same aspect ratio (within 1 %), as ARToolKit's
/// camera files are meant; nullopt for another aspect ratio or a size of 0.
std::optional<Imager> resized(const Imager& imager, int width, int height);

/// An imager without distortion, horizontal field of view `fov_deg`, principal point at ((w-1)/2, (h-1)/2):
/// the Viewer of docs/formats.md.
Imager viewer_imager(const Pose& world_from_viewer, int width, int height, double fov_deg);

}  // namespace limn
