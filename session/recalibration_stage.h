#pragma once

#include <memory>

#include "session/live_recalibration.h"
#include "session/perception.h"
#include "session/session.h"
#include "session/session_output.h"

namespace limn::apps {

class FrameClock;

/// The devices of a running session, as its recalibration captures with them.
class CaptureDevices {
 public:
  virtual ~CaptureDevices() = default;
  /// What a Repair needs of the devices; images go to `writer`.
  virtual Surroundings surroundings(ImageWriter* writer) = 0;
  /// From now on nothing is perceived, for cameras see patterns. The session takes what was perceived before.
  virtual void pause_perception(Session* session) = 0;
  virtual void resume_perception() = 0;
  /// Whether no frame is shown while the result is computed either: the clock stands meanwhile.
  virtual bool waits_for_result() const = 0;
};

/// The frame loop's first stage: recalibrates the rig of a running session when somebody asks for it
/// (session/live_recalibration.h), with the session's own devices.
class RecalibrationStage {
 public:
  /// Borrows all of them. `devices` may be null: what is asked for is left alone.
  RecalibrationStage(Perception* perception,
                     Session* session,
                     SessionOutput* output,
                     CaptureDevices* devices);

  /// Begins one that was asked for, does what a running one wants of the devices (10 ms at most, and a
  /// pattern's time), and lets the session go on with the mended rig of one that is over.
  void step(const FrameClock& clock);
  /// Whether the projectors' light is its own: no frame is to be composed.
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

}  // namespace limn::apps
