#pragma once

#include <map>
#include <vector>

#include "calib/board/board_finder.h"
#include "core/frame.h"

namespace limn::apps {

/// Tells when a board is held still in a new place, from its corners in one camera's frames.
class StillBoard {
 public:
  enum class State { unseen, moving, known, still };  ///< known: still where it was captured

  /// The corners of the next frame; stamps must not go back.
  State take(const std::vector<calib::BoardCorner>& corners, Stamp at);
  /// Where the board is seen now has been captured: the next place must be another.
  void captured() { captured_ = last_; }

 private:
  using Corners = std::map<int, Eigen::Vector2d>;  // by id
  Corners last_, still_, captured_;                // still_: since `since_`
  Stamp since_;
};

}  // namespace limn::apps
