#pragma once

#include "core/data_tree.h"
#include "core/result.h"
#include "exchange/rig_files.h"

namespace limn::exchange {

/// Whether the document is a ProjectorCameraEnsemble of Microsoft's RoomAlive Toolkit.
bool is_roomalive(const DataNode& root);

/// The colour cameras of the Kinects and the projectors of a ProjectorCameraEnsemble. RoomAlive's axes are x
/// left, y up, z forward, for devices and pixels alike, and its lengths are metres; a pose takes the device's
/// coordinates to the world's (a camera's: those of its depth camera).
Result<RigFile> read_roomalive(const DataNode& root, const RigFileOptions& options);

}  // namespace limn::exchange
