#pragma once

#include <string>
#include <vector>

#include "calib/code/decode.h"
#include "calib/detected_mark.h"
#include "calib/observations.h"

namespace limn::calib {

struct TiePointOptions {
  /// The image is divided into this many fields across and down; each gives at most one tie point of a
  /// camera.
  int columns = 20;
  int rows = 15;
  /// Half the side of the window that a plane is fitted to, pixels. Noise of the labels averages out over it.
  int half_window = 4;
  /// Maximum standard deviation of the plane's residuals, projector pixels. More means an edge or a coarse
  /// label.
  double max_residual_px = 0.5;
};

/// Selects the tie points of a scene capture: for every camera, in each field of its image, the pixel on a
/// smooth piece of surface that most imagers measure well. Adds the projector pixels observed there, and the
/// pixels of other cameras that one of these projector pixels illuminates. The result is appended to `into`.
/// Input: `decoded[camera][projector]`.
void add_tie_points(const std::vector<std::vector<Decoded>>& decoded,
                    int pose,
                    const TiePointOptions& options,
                    Observations* into);

/// Does the same with what one camera sees around the board. The room reaches the edges of the images, where
/// boards seldom do, and so determines the lens distortion there. `decoded`: one for each projector.
void add_room_points(const std::vector<Decoded>& decoded,
                     const std::vector<BoardCorner>& board,
                     int camera,
                     int pose,
                     const TiePointOptions& options,
                     Observations* into);

/// Makes the corners of marks that several cameras see into tie points. A mark whose corners stay at the same
/// pixels wherever a camera sees it again stands still: its corners are the same four points in all poses,
/// also for cameras that see it in different poses. A mark that moves between poses gives points of its own
/// in each pose. Marks need not be of known size. Returns the names of the marks that gave points.
std::vector<std::string> add_marker_points(const std::vector<DetectedMark>& marks, Observations* into);

}  // namespace limn::calib
