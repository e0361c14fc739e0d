#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "session/device_health.h"
#include "session/overlays.h"
#include "session/session.h"
#include "session/telemetry.h"

namespace limn::apps {

/// A session as its clients meet it at one moment of its clock.
struct SessionMoment {
  Session& session;
  Telemetry& telemetry;
  const DeviceHealth& health;
  Stamp at;
  const ShownFrame* shown = nullptr;  ///< the frame that was shown just now; null: none was
  cv::Mat screen = {};                ///< the screen's newest image; empty: as before
};

/// Somebody outside a session who sends it edits and is told how it is: keys, programs over OSC, guests of
/// the remote, the operator. Its functions are called on the session's thread and must not wait.
class SessionClient {
 public:
  virtual ~SessionClient() = default;

  /// Called before a frame is composed: hands its edits to the session.
  virtual void hear(const SessionMoment& moment) = 0;
  /// Called after a frame was shown, and while a recalibration lets none be shown: tells what has changed.
  virtual void tell(const SessionMoment& moment) = 0;

  /// What is drawn over the projectors' light alone: what is recorded and told stays what was painted.
  virtual std::vector<Overlay> overlays(Session*) { return {}; }
  /// Whether the next tell() wants an image of the screen.
  virtual bool wants_screen() const { return false; }
  /// Whether it has ended the session.
  virtual bool ends_session() const { return false; }
};

}  // namespace limn::apps
