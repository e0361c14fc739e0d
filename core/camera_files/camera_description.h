#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/imager.h"
#include "core/result.h"

namespace limn {

/// The formula that a camera file's distortion coefficients belong to.
enum class DistortionKind {
  opencv,  ///< OpenCV's k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y; 0, 4, 5, 8, 12 or 14.
  fisheye  ///< OpenCV's fisheye module: k1 to k4.
};

/// A camera as files of OpenCV and its relatives describe it.
struct CameraDescription {
  std::string name;                     ///< As the file calls it; empty: it is the only one.
  std::vector<std::string> also_named;  ///< Other names that select it.
  int width = 0, height = 0;            ///< 0: not in the file.
  std::string matrix_entry;             ///< The entry that the matrix comes from, for messages.
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  std::string distortion_entry;  ///< Likewise for the coefficients.
  DistortionKind kind = DistortionKind::opencv;
  std::vector<double> coefficients;
  Pose imager_from_world;
  std::vector<std::string> remarks;  ///< What a reader of the file has to know.
};

/// The imager, after checks that the matrix is that of a camera (not transposed, normalised or skewed, with a
/// principal point near the image) and that the coefficients are of their formula. A fisheye lens becomes a
/// splined lens, which is added to `remarks` with its error. Error: what does not hold, with the entry's
/// name.
Result<Imager> imager_of(CameraDescription* camera);

}  // namespace limn
