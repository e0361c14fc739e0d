#pragma once

#include <vector>

#include "calib/board/board.h"
#include "core/imager.h"

namespace limn::apps {

/// Where to hold a board before a camera that nothing is known of yet: an imager of ordinary field of view
/// that stands in for it.
Imager assumed_camera(const std::string& name, int width, int height);

/// Places of a board (world_from_board) that hold a calibration well, in the order of their use: all over the
/// camera's image, near and far, tilted to all sides. The board fills half of the image's width or
/// height in the middle of them.
std::vector<Pose> guided_poses(const Imager& camera, const calib::Board& board);

}  // namespace limn::apps
