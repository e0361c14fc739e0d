#pragma once

#include "gui/gui.h"
#include "wizard/capture/request.h"
#include "wizard/window/wizard_view.h"

namespace limn::wizard {

/// Draws the wizard's window within a frame of `gui`. Returns the person's request.
WizardWish draw_wizard(gui::Gui& gui, const WizardView& view);

}  // namespace limn::wizard
