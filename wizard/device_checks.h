#pragma once

#include <optional>
#include <vector>

#include "calib/capture_set.h"
#include "core/result.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/display_latency.h"
#include "wizard/capture/exposure_check.h"
#include "wizard/steps.h"

namespace limn::wizard {

/// Results of the checks before the first pose.
struct CheckedDevices {
  std::vector<ExposureReading> light;  ///< projector by projector, one for every camera
  /// For each projector; none if no camera sees it or the measurement failed.
  std::vector<std::optional<DisplayLatency>> latency;
};

/// Lets every projector show its number, checks exposure and focus, measures the display latencies and passes
/// them to `backend`. `listener` gets one line for each step. Problems are reported with advice; only a
/// device that fails is an error.
Result<CheckedDevices> check_devices(const calib::CaptureSet& captures,
                                     const WizardBackend& backend,
                                     const WizardListener& listener);

}  // namespace limn::wizard
