#pragma once

#include <Eigen/Core>
#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "core/result.h"
#include "device/gui/gui_window.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/main_thread_executor.h"
#include "wizard/sequence.h"
#include "wizard/steps.h"

namespace limn::wizard {

/// What the wizard's window needs to know at the start.
struct WizardPlan {
  calib::CaptureSet captures;       ///< planned
  std::vector<std::string> places;  ///< for each pose, where to hold the board, as text
  /// The board's outline there in each camera's image, pixels; empty if the camera would not see it.
  std::vector<std::vector<std::vector<Eigen::Vector2d>>> targets;  ///< [pose][camera]
  std::string devices;                                             ///< the devices that were found, as text
  /// Computes new targets from a rig solved so far; empty: `targets` stay as they are.
  std::function<std::vector<std::vector<std::vector<Eigen::Vector2d>>>(const Rig&)> targets_by = nullptr;
};

/// The wizard's work: calibrate_rig() with these backend and this listener.
using WizardWork = std::function<Result<Calibrated>(const WizardBackend&, const WizardListener&)>;

/// Runs the work in a thread of its own and shows it in the window until the person closes the window.
/// `executor` runs what the work needs done in this thread. `say` gets the lines of text, too. `wish` gets
/// the person's requests. If the window is closed early, the work stops, and its error is returned.
Result<Calibrated> calibrate_in_window(gui::GuiWindow* window,
                                       const WizardPlan& plan,
                                       const WizardBackend& backend,
                                       const std::function<void(const std::string&)>& say,
                                       std::atomic<WizardWish>* wish,
                                       MainThreadExecutor* executor,
                                       const WizardWork& work);

}  // namespace limn::wizard
