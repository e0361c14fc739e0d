#pragma once

#include "core/camera_files/camera_description.h"
#include "core/result.h"
#include "exchange/rig_files.h"

namespace limn::exchange {

/// Adds a device as camera0, camera1 … or projector0 …, of the size that the description has or `options`
/// give. Error: there is no size, or there are two different ones; or imager_of()'s.
Status add_device(CameraDescription* device, bool is_projector, const RigFileOptions& options, RigFile* file);

/// Makes the coordinate frame of the first camera the world.
void move_world_to_first_camera(Rig* rig);

}  // namespace limn::exchange
