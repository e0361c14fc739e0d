#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "core/enum_names.h"
#include "core/lens.h"
#include "core/pose.h"

namespace limn {

/// Largest width and height of an imager, in pixels; GL 4.5 guarantees textures of this size.
inline constexpr int k_max_side = 16384;

/// The light that a camera receives.
enum class Spectrum {
  visible,
  infrared  ///< through a filter that blocks projected light
};
/// Their names in files.
inline constexpr EnumNames<Spectrum, 2> k_spectra{{"visible", "infrared"}};

/// A half-line: origin (m) and unit direction.
struct Ray {
  Eigen::Vector3d p_origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d d = Eigen::Vector3d::UnitZ();
};

/// A camera or a projector: both have the same geometry.
/// Axes: x right, y down, z forward; pixel (0,0) is the centre of the top-left pixel.
struct Imager {
  std::string name;
  int width = 0;
  int height = 0;
  Lens lens;
  Pose imager_from_world;
  Spectrum sees = Spectrum::visible;  ///< only for cameras

  /// Pixel of a world point, which may lie outside the image; nullopt when the point has no pixel (behind the
  /// imager).
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_world) const;
  /// Ray of a pixel in the world; nullopt when the pixel has no direction.
  std::optional<Ray> ray(const Eigen::Vector2d& px) const;
  /// Whether px lies in the image, including the whole area of the outermost pixels.
  bool contains(const Eigen::Vector2d& px) const;
};

/// The same imager at another resolution of the same aspect ratio (within 1 %); ARToolKit uses its camera
/// files this way. Nullopt for another aspect ratio or a size of 0.
std::optional<Imager> resized(const Imager& imager, int width, int height);

/// An imager without distortion, with the horizontal field of view `fov_deg` and the principal point at
/// ((w-1)/2, (h-1)/2): the Viewer of docs/formats.md.
Imager viewer_imager(const Pose& world_from_viewer, int width, int height, double fov_deg);

}  // namespace limn
