#pragma once

#include <vector>

#include "calib/board/board.h"
#include "core/imager.h"

namespace limn::wizard {

/// An imager with a typical field of view, used in place of a camera whose lens is not known yet.
Imager assumed_camera(const std::string& name, int width, int height);

/// Board poses (world_from_board) that determine a calibration well, in the order of use: all over the
/// camera's image, near and far, tilted to all sides. At the middle distance the board fills half of the
/// image's width or height.
std::vector<Pose> guided_poses(const Imager& camera, const calib::Board& board);

}  // namespace limn::wizard
