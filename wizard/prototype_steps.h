#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/capture_set.h"
#include "calib/judge/error_map.h"
#include "core/result.h"
#include "wizard/capture/backend.h"
#include "wizard/steps.h"

namespace limn::apps {

/// What the wizard's last steps work with.
struct PrototypeSteps {
  std::filesystem::path rig;    ///< folder that is solved; the steps write into its folder `scan`
  std::filesystem::path scene;  ///< whose prototype is laid onto the scan; empty: the scan alone
  calib::CaptureSet captures;   ///< planned: devices and patterns
  std::vector<calib::ErrorMap> maps;
};

/// What came of the prototype.
struct PrototypeSeen {
  std::size_t points = 0;              ///< of the scan
  double scan_stddev_mm = 0;           ///< median
  std::optional<double> align_rms_mm;  ///< of the scan from the CAD; none: not aligned
  double painted_p95_mm = 0;           ///< predicted error of light on it
  double painted_good = 0;             ///< share of it with at most calib::k_good_mm
  std::vector<std::string> warnings;
};

/// After the rig is solved: the prototype is waited for and scanned, the scene's CAD laid onto the scan (from
/// its markers where they are seen, else from a search), and every projector paints onto it how far light may
/// be off there (error_rgb). Files in `scan`: those of limn scan and limn align, captures/,
/// painted-CAMERA.png and projector-NAME.png. nullopt: a person skipped it. An alignment that is not found is
/// told, and the scan is painted. Needs a machine that can draw (device::GlContext).
Result<std::optional<PrototypeSeen>> prototype_seen(const PrototypeSteps& steps,
                                                    const Surroundings& surroundings,
                                                    const WizardAudience& audience);

}  // namespace limn::apps
