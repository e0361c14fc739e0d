#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/capture_set.h"
#include "calib/judge/error_map.h"
#include "calib/surface/scan_size.h"
#include "core/result.h"
#include "wizard/capture/backend.h"
#include "wizard/steps.h"

namespace limn::wizard {

/// Input of the wizard's last steps: scan, alignment and painting.
struct PrototypeSteps {
  std::filesystem::path rig;    ///< solved rig folder; the steps write into its folder `scan`
  std::filesystem::path scene;  ///< its prototype is aligned with the scan; empty: no alignment
  calib::CaptureSet captures;   ///< planned: devices and patterns
  std::vector<calib::ErrorMap> maps;
};

/// Results of these steps.
struct PrototypeSeen {
  std::size_t points = 0;              ///< number of points of the scan
  double scan_stddev_mm = 0;           ///< median of the points' standard deviations
  std::optional<double> align_rms_mm;  ///< RMS distance of scan and CAD; none: not aligned
  calib::ScanSize size = {};           ///< the scan's, beside the CAD; a deviation of 0: not compared
  double painted_p95_mm = 0;           ///< 95th percentile of light's predicted error on the prototype
  double painted_good = 0;             ///< share of the lit pixels with at most calib::k_good_mm
  std::vector<std::string> warnings;
};

/// Runs after the rig is solved. Waits for the prototype, scans it, aligns the scene's CAD with the scan (the
/// start comes from visible markers, else from a search), and then every projector shows the predicted error
/// on the prototype as colours (error_rgb). Files in `scan`: those of limn scan and limn align, captures/,
/// painted-CAMERA.png and projector-NAME.png. nullopt: a person skipped it. If no alignment is found, this is
/// reported, and the scan is painted. Needs a machine that can draw (device::GlContext).
Result<std::optional<PrototypeSeen>> prototype_seen(const PrototypeSteps& steps,
                                                    const WizardBackend& backend,
                                                    const WizardListener& listener);

}  // namespace limn::wizard
