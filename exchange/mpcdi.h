#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/imager.h"

namespace limn::apps {

/// A pinhole image by the angles of its edges from the line of sight (degrees; left and down are negative
/// as a rule), turned from its coordinate frame's forward: to the right by yaw, then up by pitch, then the
/// right side down by roll.
struct MpcdiFrustum {
  double yaw = 0, pitch = 0, roll = 0;
  double left = 0, right = 0, up = 0, down = 0;
};

/// Where a projector is, and which way is right, down and forward in those coordinates (MPCDI's axes of
/// pitch, yaw and roll): unit vectors, each at a right angle to the others.
struct MpcdiFrame {
  Eigen::Vector3d p_eye = Eigen::Vector3d::Zero();  ///< m
  Eigen::Vector3d d_right = Eigen::Vector3d::UnitX();
  Eigen::Vector3d d_down = -Eigen::Vector3d::UnitY();
  Eigen::Vector3d d_forward = -Eigen::Vector3d::UnitZ();
};

/// A map of blending, 8 or 16 bits, one channel or BGR, of the region's size.
struct MpcdiBlendMap {
  cv::Mat image;
  double gamma_embedded = 1;  ///< light = value ^ gamma; of alpha maps only
};

/// One projector's image.
struct MpcdiRegion {
  std::string id, buffer;
  int width = 0, height = 0;
  double x = 0, y = 0, x_size = 1, y_size = 1;  ///< its part of the buffer
  std::optional<MpcdiFrustum> frustum;
  std::optional<MpcdiFrame> frame;
  /// CV_32FC3, a node for every pixel or for a coarser grid; NaN where there is none. Points (m) of profiles
  /// a3 and sl; else the place (x right, y down, 0 … 1) in the frustum's or the buffer's image.
  cv::Mat warp;
  std::string origin = "unknown";  ///< of the points: centerOfMass, idealEyePoint, floorCenter, unknown
  std::optional<MpcdiBlendMap> alpha, beta;
  /// CV_32FC3: the place (x right, y down, 0 … 1) in the frustum's image of what each pixel shows: the
  /// lens.
  cv::Mat distortion;
  std::optional<Lens> lens;     ///< by Limn's own extension
  bool has_other_lens = false;  ///< fisheye or anamorphic, by Christie's extension: not the frustum's pinhole
};

/// What VESA's Multiple Projection Common Data Interchange says of projectors.
struct Mpcdi {
  std::string profile =
      "sl";  ///< 2d, 3d (seen from one eye), a3 (points), sl (points and the projectors' poses)
  std::string version = "2.0";
  std::string date;
  std::string made_by;   ///< by its extension; empty when it does not say
  int colour_level = 1;  ///< 2: with beta maps
  std::vector<MpcdiRegion> regions;
  std::vector<std::string> remarks;  ///< of a reader: what was passed over
};

/// The pinhole frustum around everything that an imager's image holds, and its frame, in `world`
/// coordinates of which `axes` says what is right, down and forward (p_eye is not used).
void place_frustum(const Imager& imager, const MpcdiFrame& axes, MpcdiRegion* region);

/// A region's frustum as an imager; its lens is Limn's own where the file has one, else the frustum's
/// pinhole. Nullopt without a frustum and frame, or with a lens that the frustum does not describe.
std::optional<Imager> imager_of(const MpcdiRegion& region);

/// CV_32FC3: the place in the region's frustum of what each pixel of its imager shows, as `distortion` says.
cv::Mat places_in_frustum(const MpcdiFrustum& frustum, const Imager& imager);

}  // namespace limn::apps
