#pragma once

#include <optional>
#include <string_view>

#include "core/imager.h"
#include "core/result.h"

namespace limn {

/// Version (1 to 5) of an ARToolKit `camera_para.dat`, told from its size and first bytes; nullopt: it is
/// none.
std::optional<int> artoolkit_version(std::string_view bytes);

/// Reads an ARToolKit camera. Versions 4 and 5 are OpenCV's lens (LENSMODEL_OPENCV4 and OPENCV12). The
/// distortion of versions 1 to 3 acts in the image plane; it is refitted as LENSMODEL_OPENCV8, and a refit
/// that is off by more than 0.5 px is an error.
Result<Imager> read_artoolkit(std::string_view bytes);

}  // namespace limn
