#pragma once

namespace limn::remote {

/// Which parts a guest's window draws.
enum class TabletViewMode {
  as_screen,  ///< As the room's screen, but `view` parts whole if they are projected for another viewpoint.
  rest,       ///< What light does not show, for any viewpoint.
  full        ///< Whole parts.
};

}  // namespace limn::remote
