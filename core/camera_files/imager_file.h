#pragma once

#include <filesystem>

#include "core/imager.h"
#include "core/result.h"

namespace limn {

/// Reads a single camera from a file of another program. The format is found from the content:
/// - mrcal: `.cameramodel`, `.cahvor`.
/// - OpenCV and what is spelled like it (YAML, XML, JSON): cv::FileStorage in all its forms, lists of numpy,
/// ROS
///   camera_info, Kalibr camchains, PhotonVision, ORB-SLAM (camera_document.h).
/// - ARToolKit `camera_para.dat`, versions 1 to 5.
///
/// `path` may be FILE:NAME for one of several cameras in a file ("stereo.yml:left", "camchain.yaml:cam1").
/// Without a size in the file the imager is 0x0. Without a pose it stands at the world's origin.
/// Fisheye lenses become a LENSMODEL_SPLINED_STEREOGRAPHIC within 0.02 px, which a message states.
/// Error: an entry that is missing, not understood or no camera's; the message names it. A file of a format
/// that Limn does not read: the message names the format and says how to convert it.
Result<Imager> load_imager(const std::filesystem::path& path);

}  // namespace limn
