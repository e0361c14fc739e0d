#pragma once

#include "apps/window/gui.h"
#include "apps/wizard/wizard_request.h"
#include "apps/wizard/wizard_view.h"

namespace limn::apps {

/// The wizard's window, drawn within a frame of `gui`. Returns what the person wishes.
WizardWish draw_wizard(Gui& gui, const WizardView& view);

}  // namespace limn::apps
