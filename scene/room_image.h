#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "core/config.h"
#include "core/result.h"

namespace limn::scene {

/// A picture of the whole room that parts are shaded by, beside soft light and lamps: equirectangular linear
/// light. The top row is above, the middle of the image lies towards `image_from_world`'s third row, and its
/// columns go to the right as seen from inside.
struct RoomImage {
  std::filesystem::path file;
  cv::Mat light;  ///< CV_32FC3, BGR; 1 is the light that a white surface reflects in a room of 1 everywhere.
  Eigen::Matrix3d image_from_world = Eigen::Matrix3d::Identity();  ///< Rows: right, up, ahead; world frame.

  /// The light from a direction (unit length, world frame), linear BGR, interpolated between pixels.
  Eigen::Vector3f from(const Eigen::Vector3d& d_world) const;
};

/// Reads `image` of a scene's light (config/README.md); the file is not read yet. `d_up_world`: the light's.
RoomImage read_room_image(const ConfigNode& node, const Eigen::Vector3d& d_up_world);

/// Reads the image's file. Error: as read_hdr_image(), or it is not twice as wide as high.
Status load_room_image(RoomImage* image);

/// The light of an equirectangular image at a place; u and v are 0 … 1 from its left and upper borders. It
/// repeats to the sides.
Eigen::Vector3f light_at(const cv::Mat& light, double u, double v);

}  // namespace limn::scene
