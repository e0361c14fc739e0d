#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "calib/judge/assess.h"
#include "calib/judge/scale_bar.h"
#include "calib/model_selection.h"
#include "calib/observations.h"
#include "calib/report/advice.h"
#include "calib/report/history.h"
#include "calib/solve.h"
#include "core/result.h"

namespace limn::calib {

/// Everything that a rig folder says about a calibration.
struct Report {
  Observed observed;
  Solution solution;
  Assessment assessment;
  std::vector<std::pair<std::string, double>> seconds;  ///< of each stage, in order
  std::vector<ModelTrial> lens_trials = {};              ///< empty where the models were given
  Explanation explanation = {};                                     ///< the verdict and what to do, in sentences
  std::string made_at = {};                             ///< as PastCalibration::made_at
  History history = {};                                 ///< of the folder that the report is for
  std::vector<ScaleBarCheck> scale_bar_lengths = {};
};

/// report.json, as docs/formats.md describes it.
std::string report_json(const Report& report);

/// report.html: self-contained, images first (SVG): the verdict in words, faults and advice; the predicted
/// error over the volume; each unseen pose; where each imager was observed and what was left over there; the
/// figures behind it; earlier calibrations of the rig. Only the date differs from run to run; the stages'
/// seconds stand in report.json.
std::string report_html(const Report& report);

/// Writes the rig folder: rig.json, one .cameramodel for each device, observations.json, report.json,
/// report.html. Each file replaces its predecessor only when it is complete. rig.json's provenance says from
/// what and how.
Status write_rig_folder(const Report& report,
                        const SolveOptions& options,
                        const std::filesystem::path& folder);

}  // namespace limn::calib
