#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/camera_files/camera_description.h"
#include "core/imager.h"
#include "core/result.h"

namespace limn::exchange {

/// A lens as OpenCV and its relatives write it.
struct WrittenLens {
  DistortionKind kind = DistortionKind::opencv;
  double fx = 1, fy = 1, cx = 0, cy = 0;  ///< Pixels.
  std::vector<double> coefficients;
  double worst_px = 0;  ///< Largest error over the image; 0: the same formula.
};

/// Largest error of a lens that is fitted because a format does not have its formula.
inline constexpr double k_most_written_px = 0.1;

/// The imager's lens with one of these numbers of OpenCV's coefficients, or as a fisheye lens. A lens of
/// another formula is fitted by the better of the two. Error: both are more than k_most_written_px off.
Result<WrittenLens> written_lens(const Imager& imager, std::span<const int> counts);

/// An OpenCV camera file (YAML of cv::FileStorage, as OpenCV's calibration sample writes it), with the pose
/// camera_from_world as a 4x4 matrix.
Result<std::string> opencv_camera_text(const Imager& imager);

/// A camera_info file of ROS, as camera_info_manager reads it (without the pose).
Result<std::string> ros_camera_text(const Imager& imager);

/// A camchain.yaml of Kalibr: the imagers as cam0, cam1 … in this order, each with its pose relative to the
/// one before (T_cn_cnm1).
Result<std::string> kalibr_text(std::span<const Imager> imagers);

}  // namespace limn::exchange
