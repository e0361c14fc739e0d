#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "calib/surface/deviation.h"

namespace limn::calib {

/// How far a scanned prototype is from its CAD, for files.
struct DeviationReport {
  std::string cad, scan;  ///< Their names.
  std::string made_at;    ///< UTC
  Deviation deviation;
  DeviationSummary summary;
  std::vector<DeviationExtreme> extremes;
  Registration registration;
  std::string start;  ///< Where the alignment started: `search`, `points`, …; `given`: it was not aligned.
  std::optional<Eigen::AlignedBox3d>
      fit_box;                        ///< The box that the alignment used, in the prototype's frame (m).
  std::vector<std::string> warnings;  ///< Sentences.
  double seconds = 0;
};

/// What people must know of a comparison before they believe it, as sentences: directions that the shape does
/// not determine, places that were not measured, a scan that is noisier than it says.
std::vector<std::string> deviation_warnings(const Deviation& deviation,
                                            const DeviationSummary& summary,
                                            const Registration& registration);

/// The result in one sentence.
std::string deviation_text(const DeviationSummary& summary, double tolerance_m);

/// deviation.json (limn.deviation/1), deviation.csv, deviation.ply (binary) and the page deviation.html,
/// which is one file. Their fields: docs/formats.md.
std::string deviation_json(const DeviationReport& report);
std::string deviation_csv(const Deviation& deviation);
std::string deviation_ply(const Deviation& deviation);
std::string deviation_html(const DeviationReport& report);

}  // namespace limn::calib
