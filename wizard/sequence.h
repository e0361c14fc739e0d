#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/capture_set.h"
#include "calib/report/report.h"
#include "core/result.h"
#include "wizard/capture/backend.h"
#include "wizard/pose_quality.h"
#include "wizard/prototype_steps.h"
#include "wizard/steps.h"

namespace limn::wizard {

struct WizardOptions {
  std::filesystem::path out;         ///< the rig folder; all images stay in its captures/
  std::filesystem::path scene = {};  ///< the prototype's scene; empty: the scan is not aligned with a CAD
  bool scan = false;                 ///< scan the prototype at the end and show the predicted error on it
  bool all = false;                  ///< capture every pose of the plan, even if fewer are enough
};

/// Results of a run of the wizard.
struct Calibrated {
  std::vector<PoseJudged> poses;
  calib::Report report;  ///< as limn solve writes it
  /// Duration of this run's captures, s on the cameras' clock, by name of the projector.
  std::vector<std::pair<std::string, double>> capture_s;
  /// Measured display latency, s from show() to light, by name of the projector; from an earlier run if this
  /// one captured nothing.
  std::vector<std::pair<std::string, double>> latency_s;
  std::optional<PrototypeSeen> prototype;  ///< none: not asked for, skipped or failed
  std::string no_prototype;                ///< why the prototype's steps failed; empty: they did not
  double seconds = 0;                      ///< duration of the run, wall clock
};

/// Runs the wizard. Each pose of `captures` (planned; its folder is options.out / "captures", new or partly
/// filled) is captured unless it is already there, then decoded, solved and judged; `listener` gets one line
/// for each. The devices are checked before the first capture (wizard/device_checks.h). At the end the rig is
/// solved as limn solve does it. `places`: for each pose, where to hold the board, as text. Captures of
/// another plan are an error that says what differs; `plan_json` describes this plan. After a failure, the
/// images stay on the disk, and the next run continues from them. If a person leaves, this is an error, too.
Result<Calibrated> calibrate_rig(const WizardOptions& options,
                                 const std::string& plan_json,
                                 const calib::CaptureSet& captures,
                                 const std::vector<std::string>& places,
                                 const WizardBackend& backend,
                                 const WizardListener& listener);

}  // namespace limn::wizard
