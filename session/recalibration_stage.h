#pragma once

#include <memory>

#include "session/live_recalibration.h"
#include "session/perception.h"
#include "session/session.h"
#include "session/session_output.h"

namespace limn::session {

class FrameClock;

/// The devices of a running session, as its recalibration uses them.
class CaptureDevices {
 public:
  virtual ~CaptureDevices() = default;
  /// The device functions that a LiveRecalibration needs; images go to `writer`.
  virtual wizard::WizardBackend backend(ImageWriter* writer) = 0;
  /// Stops perception, because the cameras will see patterns. The session receives the last percepts from
  /// before.
  virtual void pause_perception(Session* session) = 0;
  virtual void resume_perception() = 0;
  /// Whether no frames are shown while the result is computed either; the clock stands still meanwhile.
  virtual bool waits_for_result() const = 0;
};

/// The frame loop's first stage: recalibrates the rig of a running session on request, with the session's own
/// devices (session/live_recalibration.h).
class RecalibrationStage {
 public:
  /// Borrows all of them. `devices` may be null: requests are ignored then.
  RecalibrationStage(Perception* perception,
                     Session* session,
                     SessionOutput* output,
                     CaptureDevices* devices);

  /// Starts a requested recalibration; executes the device calls of a running one (waits 10 ms at most for
  /// one, which may show a pattern); applies the result of a finished one.
  void step(const FrameClock& clock);
  /// Whether it uses the projectors, so that no frame may be composed.
  bool holds_light() const {
    return recalibration_ && (devices_->waits_for_result() || recalibration_->is_capturing());
  }

 private:
  void begin(const FrameClock& clock);
  void pause();
  void resume();

  Perception* perception_;
  Session* session_;
  SessionOutput* output_;
  CaptureDevices* devices_;
  std::unique_ptr<LiveRecalibration> recalibration_;
  bool is_paused_ = false;
};

}  // namespace limn::session
