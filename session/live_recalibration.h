#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <future>
#include <optional>
#include <string>

#include "core/image_writer.h"
#include "session/perception.h"
#include "session/session.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/main_thread_executor.h"
#include "wizard/capture/rig_recheck.h"

namespace limn::session {

/// A new folder for a corrected rig of a session: in `out`, or in Limn's own folder if `out` is empty.
Result<std::filesystem::path> recalibration_folder(const std::filesystem::path& out);

/// Rechecks the rig of a running session with patterns on the prototype as it stands
/// (wizard/capture/rig_recheck.h), using the session's own devices. The recheck runs on a thread of its own;
/// its device calls are executed by serve() on the session's thread, which can respond to people in between.
/// After the last photograph the session may show frames again while the result is computed with low
/// priority.
class LiveRecalibration {
 public:
  /// `backend` must set capture, wait_for_files and use_latency; its images go to the writer that it is
  /// given.
  LiveRecalibration(const Rig& rig,
                    std::filesystem::path folder,
                    const std::function<wizard::WizardBackend(ImageWriter*)>& backend);
  /// Cancels the recheck; this takes a second at most.
  ~LiveRecalibration();
  LiveRecalibration(const LiveRecalibration&) = delete;
  LiveRecalibration& operator=(const LiveRecalibration&) = delete;

  /// Executes a device call that is pending or comes within `wait`.
  void serve(std::chrono::nanoseconds wait) { executor_.serve(wait); }
  /// Whether it still uses the devices.
  bool is_capturing() const { return is_capturing_; }
  /// The progress in words: "12 of 44 patterns", "computing".
  std::string words() const;
  /// The result when it is finished, once; otherwise nullopt.
  std::optional<Result<wizard::Rechecked>> take_result();

  const std::filesystem::path& folder() const { return folder_; }

 private:
  wizard::WizardBackend run_on_session_thread(wizard::WizardBackend backend);

  std::filesystem::path folder_;
  int images_ = 0;
  std::atomic<int> shown_ = 0;
  std::atomic<bool> is_capturing_ = true, is_over_ = false;
  wizard::MainThreadExecutor executor_;
  ImageWriter writer_;
  std::future<Result<wizard::Rechecked>> result_;
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
