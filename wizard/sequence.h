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

namespace limn::apps {

struct WizardOptions {
  std::filesystem::path out;         ///< the rig folder; its captures/ keeps every image
  std::filesystem::path scene = {};  ///< of the prototype; empty: the scan is painted without a CAD
  bool scan = false;                 ///< scan the prototype at the end, and paint it
  bool all = false;                  ///< take every pose of the plan, although fewer are enough
};

/// What a run of the wizard gave.
struct Calibrated {
  std::vector<PoseJudged> poses;
  calib::Report report;  ///< as limn solve writes it
  /// Of the captures taken by this run, on the cameras' clock: by name of the projector.
  std::vector<std::pair<std::string, double>> capture_s;
  /// Measured, from show to light, by name of the projector; those of an earlier run where this one captured
  /// nothing.
  std::vector<std::pair<std::string, double>> latency_s;
  std::optional<PrototypeSeen> prototype;  ///< none: not asked for, skipped, or `no_prototype` says why
  std::string no_prototype;
  double seconds = 0;  ///< the run, by the wall
};

/// The sequence: pose after pose of `captures` (planned, its folder is options.out / "captures"; begun or
/// not) is captured unless it is there already, decoded, solved and judged, with a line each to `audience`;
/// before the first one that is captured the devices are checked (wizard/device_checks.h). Then the rig is
/// solved as limn solve does it. `places`: where each pose's board is to be held, in words. Captures that
/// another plan made are an error that says what differs; `plan_json` describes this one. Whatever fails,
/// images on the disk stay there, and the next run goes on from them; leaving is an error, too.
Result<Calibrated> calibrated(const WizardOptions& options,
                              const std::string& plan_json,
                              const calib::CaptureSet& captures,
                              const std::vector<std::string>& places,
                              const Surroundings& surroundings,
                              const WizardAudience& audience);

}  // namespace limn::apps
