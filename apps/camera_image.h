#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>

#include "core/imager.h"
#include "core/result.h"

namespace limn::apps {

/// Reads an image that this camera took, in grey. Error: it cannot be read, or does not have the camera's
/// size (a camera of size 0 takes images of any size).
Result<cv::Mat> read_image_of(const Imager& camera, const std::filesystem::path& path);

}  // namespace limn::apps
