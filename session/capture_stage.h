#pragma once

#include <memory>
#include <string>

#include "session/capture_task.h"
#include "session/perception.h"
#include "session/session.h"
#include "session/session_output.h"

namespace limn::session {

class FrameClock;

/// The devices of a running session, as its captures use them.
class CaptureDevices {
 public:
  virtual ~CaptureDevices() = default;
  /// The device functions that a CaptureTask needs; images go to `writer`.
  virtual wizard::WizardBackend backend(ImageWriter* writer) = 0;
  /// Stops perception, because the cameras will see patterns. The session receives the last percepts from
  /// before.
  virtual void pause_perception(Session* session) = 0;
  virtual void resume_perception() = 0;
  /// Whether no frames are shown while the result is computed either; the clock stands still meanwhile.
  virtual bool waits_for_result() const = 0;
};

/// A capture by the session's devices and what is computed from it.
class CaptureJob {
 public:
  virtual ~CaptureJob() = default;
  virtual CapturePort& port() = 0;
  /// Whether the computation has ended.
  virtual bool is_computed() const = 0;
  /// Whether the result may be applied: it may need a look at what the cameras see after the capture. Called
  /// in each turn of the loop once the capture has ended.
  virtual bool is_ready(const Session& session, Stamp now) = 0;
  /// Applies the result. Perception is paused.
  virtual void apply(Stamp at, Perception* perception, Session* session) = 0;
  /// Shows people how far it is; empty: it has ended.
  virtual void show_progress(const std::string& words, Session* session) const = 0;
};

/// The frame loop's first stage: captures with the session's own devices on request, one request after the
/// other: recalibration of the rig (session/live_recalibration.h) and comparison of the prototype with its
/// CAD (session/deviation_job.h).
class CaptureStage {
 public:
  /// Borrows all of them. `devices` may be null: requests are ignored then.
  CaptureStage(Perception* perception, Session* session, SessionOutput* output, CaptureDevices* devices);

  /// Starts what was requested; executes the device calls of what runs (waits 10 ms at most for one, which
  /// may show a pattern); applies the result of what has finished.
  void step(const FrameClock& clock);
  /// Whether it uses the projectors, so that no frame may be composed.
  bool holds_light() const {
    return job_ && (job_->port().is_capturing() || (devices_->waits_for_result() && !job_->is_computed()));
  }

 private:
  void begin_requested(Stamp now);
  Result<std::unique_ptr<CaptureJob>> new_job(Stamp now);
  void pause();
  void resume();

  Perception* perception_;
  Session* session_;
  SessionOutput* output_;
  CaptureDevices* devices_;
  std::unique_ptr<CaptureJob> job_;
  bool is_paused_ = false;
};

}  // namespace limn::session
