#pragma once

#include <filesystem>

#include "core/imager.h"
#include "core/result.h"

namespace limn {

/// Reads a single imager from one of these files:
/// - A `.cameramodel` of mrcal.
/// - An OpenCV camera file (YAML, XML or JSON of cv::FileStorage) with camera_matrix,
///   distortion_coefficients, image_width and image_height. Without a size the imager is 0x0.
/// - An ARToolKit `camera_para.dat`, versions 1 to 4. Its distortion acts in the image plane; it is refitted
///   as LENSMODEL_OPENCV8, and a refit that is off by more than 0.5 px is an error.
/// The latter two have no pose: their imager stands at the world's origin.
Result<Imager> load_imager(const std::filesystem::path& path);

}  // namespace limn
