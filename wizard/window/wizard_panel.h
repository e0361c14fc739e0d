#pragma once

#include "gui/gui.h"
#include "wizard/capture/request.h"
#include "wizard/window/wizard_view.h"

namespace limn::apps {

/// The wizard's window, drawn within a frame of `gui`. Returns what the person wishes.
WizardWish draw_wizard(Gui& gui, const WizardView& view);

}  // namespace limn::apps
