#pragma once

#include <Eigen/Core>
#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "core/result.h"
#include "gui/gui_window.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/main_thread_executor.h"
#include "wizard/sequence.h"
#include "wizard/steps.h"

namespace limn::apps {

/// What the wizard's window is told beforehand.
struct WizardPlan {
  calib::CaptureSet captures;       ///< planned
  std::vector<std::string> places;  ///< where each pose's board is to be held, in words
  /// The same as the board's outline in each camera's image, pixels; empty where it would not be seen.
  std::vector<std::vector<std::vector<Eigen::Vector2d>>> targets;  ///< [pose][camera]
  std::string devices;                                             ///< what was found, in words
  /// The targets once a rig is known; empty: they are known beforehand.
  std::function<std::vector<std::vector<std::vector<Eigen::Vector2d>>>(const Rig&)> targets_by = nullptr;
};

/// The wizard's work, as calibrated() with these surroundings and this audience.
using WizardWork = std::function<Result<Calibrated>(const Surroundings&, const WizardAudience&)>;

/// Does the work in a thread of its own while the window shows it, until the person closes the window; what
/// the work wants done in this thread meanwhile comes by `errands`. `say` gets the lines, too. `wish`: the
/// person's. Closed early, the work is left: its error comes back.
Result<Calibrated> calibrated_in_window(GuiWindow* window,
                                        const WizardPlan& plan,
                                        const Surroundings& surroundings,
                                        const std::function<void(const std::string&)>& say,
                                        std::atomic<WizardWish>* wish,
                                        MainThreadExecutor* executor,
                                        const WizardWork& work);

}  // namespace limn::apps
