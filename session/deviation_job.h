#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "core/result.h"
#include "session/capture_stage.h"

namespace limn::session {

// The comparison of a running session's prototype with its CAD (action `deviation`), as jobs of the
// CaptureStage. Their results go to Session::deviation() and are shown. A failure is reported, and the former
// result stays. A result is dropped when the scene or the rig has changed meanwhile.

/// Scans the prototype where it is tracked, and compares it. Perception must be paused. The result counts
/// only if the prototype is still there after the capture. `folder` is removed with the job, or with its
/// error. Error: the prototype is not tracked now.
Result<std::unique_ptr<CaptureJob>> scan_job(
    const Session& session,
    const std::filesystem::path& folder,
    const std::function<wizard::WizardBackend(ImageWriter*)>& backend,
    Stamp now);

/// Compares the last scan again, with the tolerance and the fit that are chosen now. Null: there is none.
Result<std::unique_ptr<CaptureJob>> comparison_job(const Session& session);

/// Writes the result into `folder`. Null: there is none.
Result<std::unique_ptr<CaptureJob>> report_job(const Session& session, const std::filesystem::path& folder);

}  // namespace limn::session
