#pragma once

#include <string>
#include <vector>

#include "calib/board/board.h"
#include "core/imager.h"
#include "core/pose.h"

namespace limn::apps {

/// Where to hold the board, in words, as one camera sees it: "left, low, near (1.12 m), tilted 25 degrees up,
/// turned 40 degrees clockwise" for each pose. Left, low and clockwise are the picture's; tilted up means
/// that the board's face looks further up than at the camera; near and far compare the poses with each other.
/// `camera`: its world is the one that the poses are in.
std::vector<std::string> places_in_words(const Imager& camera,
                                         const calib::Board& board,
                                         const std::vector<Pose>& world_from_board);

}  // namespace limn::apps
