#pragma once

#include "device/gui/gui.h"
#include "wizard/capture/request.h"
#include "wizard/window/board_size_input.h"
#include "wizard/window/wizard_view.h"

namespace limn::wizard {

/// Draws the wizard's window within a frame of `gui`. Returns the person's request. `size`: the entry of the
/// board's size, which the view may ask for.
WizardWish draw_wizard(gui::Gui& gui, const WizardView& view, BoardSizeInput* size);

}  // namespace limn::wizard
