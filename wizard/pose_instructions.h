#pragma once

#include <string>
#include <vector>

#include "calib/board/board.h"
#include "core/imager.h"
#include "core/pose.h"
#include "core/rig.h"

namespace limn::apps {

/// Where to hold the board, in words, as one camera sees it: "left, low, near (1.12 m), tilted 25 degrees up,
/// turned 40 degrees clockwise" for each pose. Left, low and clockwise are the image's; tilted up means
/// that the board's face looks further up than at the camera; near and far compare the poses with each other.
/// `camera`: its world is the one that the poses are in.
std::vector<std::string> pose_instructions(const Imager& camera,
                                           const calib::Board& board,
                                           const std::vector<Pose>& world_from_board);

/// The board's four corners in the image of each camera, pixels, for each of its places: [place][camera];
/// empty where one of them is behind the camera.
std::vector<std::vector<std::vector<Eigen::Vector2d>>> outlines(const calib::Board& board,
                                                                const std::vector<Pose>& world_from_board,
                                                                const std::vector<Imager>& cameras);

/// The places of a board that lies in the image of the rig's first camera where `assumed`, which stood in
/// for it, sees it at `world_from_board`; in the rig's world, as far as the rig is right. A place that cannot
/// be found is left as it is.
std::vector<Pose> placed_alike(const std::vector<Pose>& world_from_board,
                               const calib::Board& board,
                               const Imager& assumed,
                               const Rig& rig);

}  // namespace limn::apps
