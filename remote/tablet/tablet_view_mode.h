#pragma once

namespace limn::remote {

/// What a guest's window draws of the parts.
enum class TabletViewMode {
  as_screen,  ///< as the room's screen, but `view` parts whole where light shows them to another eye
  rest,       ///< what light does not show, whoever it is drawn for
  full        ///< whole parts
};

}  // namespace limn::remote
