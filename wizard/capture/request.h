#pragma once

namespace limn::apps {

/// What a person asks of a running wizard.
enum class WizardWish {
  none,
  check,   ///< look at outputs, exposure and latency again, then take the images of this pose again
  repeat,  ///< take the images of this pose again
  finish,  ///< take no more poses: solve
  scan,    ///< the prototype stands there: scan it
  skip,    ///< leave out what is waited for
  leave    ///< stop; what was captured stays, the next run goes on from there
};

}  // namespace limn::apps
