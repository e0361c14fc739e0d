#include "wizard/steps.h"

#include <array>

namespace limn::wizard {

std::string to_text(WizardStep step) {
  static const std::array<const char*, k_wizard_steps> names = {
      "devices", "outputs", "exposure and focus", "display latency", "board", "solve", "result", "scan",
      "align",   "paint"};
  return names.at(static_cast<std::size_t>(step));
}

}  // namespace limn::wizard
