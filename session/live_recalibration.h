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

namespace limn::apps {

/// Where mended rigs of a session go: a new folder in `out`, in Limn's own folder without one.
Result<std::filesystem::path> recalibration_folder(const std::filesystem::path& out);

/// The rig of a running session is checked by the prototype as it stands (wizard/capture/rig_recheck.h), with
/// the session's own devices, on a thread of its own: what it shows and photographs is done by serve(), so
/// that the session's thread answers people in between. When all is photographed the session may paint again
/// while the rest is computed, with low priority.
class LiveRecalibration {
 public:
  /// `around` needs stage, written and use_latency, which store images in the writer that it is given.
  LiveRecalibration(const Rig& rig,
                    std::filesystem::path folder,
                    const std::function<Surroundings(ImageWriter*)>& around);
  /// Ends it where it is; a second at most.
  ~LiveRecalibration();
  LiveRecalibration(const LiveRecalibration&) = delete;
  LiveRecalibration& operator=(const LiveRecalibration&) = delete;

  /// Does what is wanted of the devices, now or within `wait`.
  void serve(std::chrono::nanoseconds wait) { executor_.serve(wait); }
  /// Whether the devices are its own.
  bool is_capturing() const { return is_capturing_; }
  /// How far it is: "12 of 44 patterns", "computing".
  std::string words() const;
  /// What came of it, once, when it is over.
  std::optional<Result<Rechecked>> take();

  const std::filesystem::path& folder() const { return folder_; }

 private:
  Surroundings through_errands(Surroundings around);

  std::filesystem::path folder_;
  int images_ = 0;
  std::atomic<int> shown_ = 0;
  std::atomic<bool> is_capturing_ = true, is_over_ = false;
  MainThreadExecutor executor_;
  ImageWriter writer_;
  std::future<Result<Rechecked>> result_;
};

/// Where one device has moved, watcher and session go on with the mended rig, which is in `folder` for the
/// next session; what could not be done is told, and the session goes on as it was. Nobody may use the
/// watcher meanwhile.
void apply_recalibration(const Result<Rechecked>& checked,
                         const std::filesystem::path& folder,
                         Stamp at,
                         Perception* perception,
                         Session* session);

}  // namespace limn::apps
