#pragma once

#include <optional>
#include <vector>

#include "calib/capture_set.h"
#include "core/result.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/display_latency.h"
#include "wizard/capture/exposure_check.h"
#include "wizard/steps.h"

namespace limn::apps {

/// What the wizard found out before the first pose.
struct CheckedDevices {
  std::vector<ExposureReading> light;  ///< projector by projector, of every camera
  std::vector<std::optional<DisplayLatency>>
      latency;  ///< of each projector; none: no camera sees it, or it jitters
};

/// Outputs identify themselves, exposure and focus are judged, latencies measured and handed to the
/// surroundings, a line each to the audience. What is wrong is told with what to do; only a device that fails
/// is an error.
Result<CheckedDevices> checked_devices(const calib::CaptureSet& captures,
                                       const Surroundings& surroundings,
                                       const WizardAudience& audience);

}  // namespace limn::apps
