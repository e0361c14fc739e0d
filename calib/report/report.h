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
#include "calib/surface/scan_size.h"
#include "core/result.h"

namespace limn::calib {

/// The content of a rig folder.
struct Report {
  Observed observed;
  Solution solution;
  Assessment assessment;
  std::vector<std::pair<std::string, double>> seconds;  ///< time of each stage, in order
  std::vector<ModelTrial> lens_trials = {};             ///< empty where the models were given
  Explanation explanation = {};                         ///< the verdict and the advice, as sentences
  std::string made_at = {};                             ///< as PastCalibration::made_at
  History history = {};                                 ///< history of the folder that the report is for
  std::vector<ScaleBarCheck> scale_bar_lengths = {};
  /// What the scale rests on: board, board_measured, markers, known_length or cad.
  std::string scale_rests_on = "board";
  /// Markers (`family:id`) whose corners were tie points, because several cameras saw them.
  std::vector<std::string> tie_markers = {};
};

/// report.json, as docs/formats.md describes it.
std::string report_json(const Report& report);

/// report.html: self-contained, plots first (SVG): the verdict as text, faults and advice; the predicted
/// error over the volume; the held-out errors of each pose; where each imager has observations, and their
/// residuals; the tables behind it; earlier calibrations of the rig. Only the date differs from run to run;
/// the stages' times are in report.json.
std::string report_html(const Report& report);

/// Notes how large the scan of a prototype is beside its CAD, where that tells the size of the rig better
/// than nothing: the scale rests on the CAD then, and the verdict says so, or `wrong_scale` is a fault.
/// Whether the report has changed. Sizes that are less certain than a print's, and a board whose size was
/// checked before, change nothing.
bool note_cad_size(const ScanSize& size, Report* report);

/// Writes report.json and report.html of a rig folder again, both or none.
Status write_report(const Report& report, const std::filesystem::path& folder);

/// Writes the rig folder: rig.json, one .cameramodel for each device, observations.json, report.json,
/// report.html. Each file replaces its predecessor only when it is complete. The provenance in rig.json
/// states the captures and the options.
Status write_rig_folder(const Report& report,
                        const SolveOptions& options,
                        const std::filesystem::path& folder);

}  // namespace limn::calib
