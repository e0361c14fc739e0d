#pragma once

#include <string>
#include <vector>

#include "calib/board/board.h"
#include "core/imager.h"
#include "core/pose.h"
#include "core/rig.h"

namespace limn::wizard {

/// For each pose, where to hold the board, as one camera sees it: "left, low, near (1.12 m), tilted 25
/// degrees up, turned 40 degrees clockwise". Left, low and clockwise are meant in the image; "tilted up"
/// means that the board faces above the camera; near and far compare the poses with each other. `camera` and
/// the poses have the same world frame.
std::vector<std::string> pose_instructions(const Imager& camera,
                                           const calib::Board& board,
                                           const std::vector<Pose>& world_from_board);

/// The board's four corners in the image of each camera, pixels, for each pose of the board: [pose][camera];
/// empty if the camera cannot project one of them, because it is behind the camera.
std::vector<std::vector<std::vector<Eigen::Vector2d>>> outlines(const calib::Board& board,
                                                                const std::vector<Pose>& world_from_board,
                                                                const std::vector<Imager>& cameras);

/// Board poses in the rig's world for which the rig's first camera sees the board where the assumed camera
/// sees it at `world_from_board`. They are as accurate as the rig. A pose that cannot be found is kept.
std::vector<Pose> placed_alike(const std::vector<Pose>& world_from_board,
                               const calib::Board& board,
                               const Imager& assumed,
                               const Rig& rig);

}  // namespace limn::wizard
