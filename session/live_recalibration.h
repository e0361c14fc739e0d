#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "session/capture_task.h"
#include "session/perception.h"
#include "session/session.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/rig_recheck.h"

namespace limn::session {

/// A new folder NAME-1, NAME-2, … for what a session leaves: in `out`, or in Limn's own folder if `out` is
/// empty.
Result<std::filesystem::path> numbered_folder(const std::filesystem::path& out, const std::string& name);

/// Rechecks the rig of a running session with patterns on the prototype as it stands
/// (wizard/capture/rig_recheck.h), using the session's own devices (CaptureTask).
class LiveRecalibration {
 public:
  /// `backend` as for CaptureTask.
  LiveRecalibration(const Rig& rig,
                    std::filesystem::path folder,
                    const std::function<wizard::WizardBackend(ImageWriter*)>& backend);

  /// As the functions of CapturePort and CaptureTask. At destruction the recheck is cancelled.
  CapturePort& port() { return task_.port(); }
  void serve(std::chrono::nanoseconds wait) { task_.port().serve(wait); }
  bool is_capturing() const { return task_.port().is_capturing(); }
  bool is_done() const { return task_.is_done(); }
  std::string words() const { return task_.port().words(); }
  std::optional<Result<wizard::Rechecked>> take_result() { return task_.take_result(); }

  const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
  CaptureTask<wizard::Rechecked> task_;
};

/// If a device has moved, perception and session continue with the corrected rig, which is kept in `folder`
/// for the next session. A failure is reported, and the session continues as before. Nothing else may use
/// `perception` during the call.
void apply_recalibration(const Result<wizard::Rechecked>& checked,
                         const std::filesystem::path& folder,
                         Stamp at,
                         Perception* perception,
                         Session* session);

}  // namespace limn::session
