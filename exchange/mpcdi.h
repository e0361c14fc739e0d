#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/imager.h"

namespace limn::exchange {

/// What a file's warp maps are.
enum class MpcdiProfile {
  shader_lamps,  ///< sl: points, and the projectors' poses.
  advanced_3d,   ///< a3: points.
  from_viewer,   ///< 3d: positions in the image of one viewpoint.
  flat           ///< 2d: positions in an image.
};
inline constexpr EnumNames<MpcdiProfile, 4> k_mpcdi_profiles{{"sl", "a3", "3d", "2d"}};
/// The profiles that Limn writes.
inline constexpr EnumNames<MpcdiProfile, 3> k_written_mpcdi_profiles{{"sl", "a3", "3d"}};
/// Whether the warp maps are points in space.
inline bool holds_points(MpcdiProfile profile) {
  return profile == MpcdiProfile::shader_lamps || profile == MpcdiProfile::advanced_3d;
}

/// A pinhole image, given by the angles of its edges from the optical axis (degrees; left and down are
/// usually negative). The axis is turned from the coordinate frame's forward direction: to the right by yaw,
/// then up by pitch; then the image is turned by roll, right side down.
struct MpcdiFrustum {
  double yaw = 0, pitch = 0, roll = 0;
  double left = 0, right = 0, up = 0, down = 0;
};

/// The position of a projector, and which directions are right, down and forward in those coordinates
/// (MPCDI's axes of pitch, yaw and roll): unit vectors, perpendicular to each other.
struct MpcdiFrame {
  Eigen::Vector3d p_eye = Eigen::Vector3d::Zero();  ///< m
  Eigen::Vector3d d_right = Eigen::Vector3d::UnitX();
  Eigen::Vector3d d_down = -Eigen::Vector3d::UnitY();
  Eigen::Vector3d d_forward = -Eigen::Vector3d::UnitZ();
};

/// A blend map, 8 or 16 bits, one channel or BGR, of the region's size.
struct MpcdiBlendMap {
  cv::Mat image;
  double gamma_embedded = 1;  ///< light = value ^ gamma; for alpha maps only.
};

/// One projector's image.
struct MpcdiRegion {
  std::string id, buffer;
  int width = 0, height = 0;
  double x = 0, y = 0, x_size = 1, y_size = 1;  ///< The region's share of the buffer.
  std::optional<MpcdiFrustum> frustum;
  std::optional<MpcdiFrame> frame;
  /// CV_32FC3, one node for each pixel or a coarser grid; NaN where there is none. Profiles a3 and sl: points
  /// in metres. Other profiles: the position (x right, y down, 0 … 1) in the image of the frustum or buffer.
  cv::Mat warp;
  std::string origin =
      "unknown";  ///< Origin of the points: centerOfMass, idealEyePoint, floorCenter or unknown.
  std::optional<MpcdiBlendMap> alpha, beta;
  /// CV_32FC3, the lens: for each pixel, the position (x right, y down, 0 … 1) in the frustum's image of what
  /// the pixel shows.
  cv::Mat distortion;
  std::optional<Lens> lens;  ///< From Limn's own extension.
  bool has_other_lens =
      false;  ///< Fisheye or anamorphic, from Christie's extension; the frustum's pinhole is then not valid.
};

/// The content of a file of VESA's Multiple Projection Common Data Interchange (MPCDI).
struct Mpcdi {
  MpcdiProfile profile = MpcdiProfile::shader_lamps;
  std::string version = "2.0";
  std::string date;
  std::string made_by;   ///< From the file's extension; empty if it does not say.
  int colour_level = 1;  ///< 2 if there are beta maps.
  std::vector<MpcdiRegion> regions;
  std::vector<std::string> remarks;  ///< What a reader ignored or assumed.
};

/// Sets the pinhole frustum that contains everything in an imager's image, and its frame, in `world`
/// coordinates in which `axes` says what is right, down and forward (axes.p_eye is not used).
void place_frustum(const Imager& imager, const MpcdiFrame& axes, MpcdiRegion* region);

/// A region's frustum as an imager. Its lens is Limn's own if the file has one, else the frustum's pinhole.
/// Nullopt if there is no frustum or frame, or if the frustum does not describe the lens.
std::optional<Imager> imager_of(const MpcdiRegion& region);

/// CV_32FC3: for each pixel of the imager, the position in the frustum's image of what the pixel shows; the
/// format of MpcdiRegion::distortion.
cv::Mat places_in_frustum(const MpcdiFrustum& frustum, const Imager& imager);

}  // namespace limn::exchange
