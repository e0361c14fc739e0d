#pragma once

#include <filesystem>

#include "core/imager.h"
#include "core/result.h"

namespace limn {

/// A single imager from a `.cameramodel`, or, at the world's origin, from an OpenCV camera file (YAML, XML or
/// JSON of cv::FileStorage: camera_matrix, distortion_coefficients, image_width, image_height; 0x0 without a
/// size) or an ARToolKit `camera_para.dat` (versions 1 to 4; their image-plane distortion is refitted as
/// LENSMODEL_OPENCV8, an error when it fits worse than 0.5 px).
Result<Imager> load_imager(const std::filesystem::path& path);

}  // namespace limn
