#pragma once

#include <vector>

#include "calib/code/decode.h"
#include "calib/observations.h"

namespace limn::calib {

struct TiePointOptions {
  /// The image is divided into so many fields across and down; each gives at most one point of a camera.
  int columns = 20;
  int rows = 15;
  /// Half the side of the window that a plane is fitted to, pixels: a label's noise averages out over it.
  int half_window = 4;
  /// Of the plane's residuals, standard deviation, projector pixels: more is an edge or a coarse label.
  double max_residual_px = 0.5;
};

/// The well-placed points of a scene capture: for every camera, in each field of its image the pixel that
/// most imagers see well, on a smooth piece of surface; with the projectors' pixels there, and the pixels of
/// other cameras that one of these projectors' pixels lights. `decoded[camera][projector]`; appended to
/// `into`.
void add_tie_points(const std::vector<std::vector<Decoded>>& decoded,
                     int pose,
                     const TiePointOptions& options,
                     Observations* into);

/// Likewise what one camera sees around the board: the room reaches the edges of the images, where boards
/// seldom do, and tells the lenses apart there. `decoded`: one for each projector.
void add_room_points(const std::vector<Decoded>& decoded,
                     const std::vector<BoardCorner>& board,
                     int camera,
                     int pose,
                     const TiePointOptions& options,
                     Observations* into);

}  // namespace limn::calib
