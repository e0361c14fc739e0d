#pragma once

#include <vector>

#include "core/camera_files/camera_description.h"
#include "core/data_tree.h"
#include "core/result.h"

namespace limn {

/// All cameras in a YAML, JSON or XML file of OpenCV, ROS (camera_info, as a file, a message or parameters),
/// Kalibr (camchain), PhotonVision, ORB-SLAM, MC-Calib, VINS, DepthAI or RealSense, or in JSON that somebody
/// wrote from numpy. These differ in the names of entries (camera_entries.h), in the form of lists, and in
/// what the entries are nested in. Without a camera in the file the list is empty.
///
/// Error, with the entry's name: a camera has no distortion entry at all, two entries have the same meaning,
/// an entry looks like distortion but is not understood, a lens model is unknown, a matrix or list has
/// another form, the image was binned or cut.
Result<std::vector<CameraDescription>> cameras_in(const DataNode& root);

}  // namespace limn
