#pragma once

namespace limn::wizard {

/// A person's request to a running wizard.
enum class WizardWish {
  none,
  check,   ///< check outputs, exposure and latency again, then capture this pose again
  repeat,  ///< capture this pose again
  finish,  ///< capture no more poses: solve
  scan,    ///< the prototype is in place: scan it
  skip,    ///< do not wait for the prototype: leave out its steps
  leave    ///< stop; the captured images stay, and the next run continues from them
};

}  // namespace limn::wizard
