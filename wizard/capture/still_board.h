#pragma once

#include <map>
#include <vector>

#include "calib/board/board_finder.h"
#include "core/frame.h"

namespace limn::wizard {

/// Detects that a board is held still in a new place, from its corners in one camera's frames.
class StillBoard {
 public:
  enum class State { unseen, moving, known, still };  ///< known: still where it was captured last

  /// Adds the corners of the next frame; stamps must not decrease.
  State add_corners(const std::vector<calib::BoardCorner>& corners, Stamp at);
  /// The board has been captured where it is now; the next place must be a different one.
  void captured() { captured_ = last_; }

 private:
  using Corners = std::map<int, Eigen::Vector2d>;  // by id
  Corners last_, still_, captured_;                // still_: the corners at `since_`
  Stamp since_;
};

}  // namespace limn::wizard
