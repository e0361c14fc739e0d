#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/rig.h"
#include "scene/meshes/mesh.h"

namespace limn::exchange {

/// What files of other programs do not say about a rig.
struct RigFileOptions {
  std::optional<scene::LengthUnit> units;            ///< Unit of the file's translations.
  std::optional<std::array<int, 2>> camera_size;     ///< Width and height in pixels.
  std::optional<std::array<int, 2>> projector_size;  ///< Likewise. OpenCV: the second device is a projector.
};

/// A rig that another program calibrated.
struct RigFile {
  Rig rig;
  std::string program;               ///< Which program or format the file is of.
  std::vector<std::string> remarks;  ///< What a reader has to know.
};

/// Reads a rig that another program calibrated. The format is found from the entries:
/// - procam-calibration (cam_int, proj_int …), SLStudio (Kc, Kp …), procamcalib (cam_K, proj_K …);
/// - OpenCV's stereo calibration (two cameras as camera_document.h finds them, R and T), in one file or in
/// two;
/// - RoomAlive Toolkit (ProjectorCameraEnsemble);
/// - MPCDI, of which only the poses are read.
///
/// Devices are camera0, camera1 …, projector0 …; the world is camera0's coordinate frame (MPCDI: names and
/// coordinate frame are the file's). R and T take coordinates of the first device to those of the second, as
/// cv::stereoCalibrate has it. Error: a file of another kind; a missing entry or one that is no camera's
/// matrix, rotation …; with wrong_usage where units or a size have to be given.
Result<RigFile> read_rig_files(const std::vector<std::filesystem::path>& files,
                               const RigFileOptions& options);

}  // namespace limn::exchange
