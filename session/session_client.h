#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "projector/overlays/overlays.h"
#include "session/device_health.h"
#include "session/session.h"
#include "session/telemetry.h"

namespace limn::session {

/// What a session hands to its clients at one moment of its clock.
struct SessionMoment {
  Session& session;
  Telemetry& telemetry;
  const DeviceHealth& health;
  Stamp at;
  const ShownFrame* shown = nullptr;  ///< the frame that was shown just now; null: none was
  cv::Mat screen = {};                ///< the screen's newest image; empty: unchanged
};

/// A client of a session sends it edits and receives its state: keys, programs over OSC, guests of the
/// remote, the operator. The functions are called on the session's thread and must not wait.
class SessionClient {
 public:
  virtual ~SessionClient() = default;

  /// Called before a frame is composed: sends the client's edits to the session.
  virtual void apply_edits(const SessionMoment& moment) = 0;
  /// Called after a frame was shown, and during a recalibration, when no frame can be shown: the client gets
  /// what has changed.
  virtual void publish_state(const SessionMoment& moment) = 0;

  /// Called with what a frame shows, before it is drawn here: other machines can draw it at the same time.
  virtual void note_description(const FrameDescription&) {}
  /// When the light of a frame can appear that is expected at a moment: displays refresh at fixed ones.
  virtual Stamp light_at(Stamp expected) const { return expected; }
  /// Overlays for the projected light only: recorded and reported images are without them.
  virtual std::vector<projector::Overlay> overlays(Session*) { return {}; }
  /// Whether the next publish_state() needs an image of the screen.
  virtual bool wants_screen() const { return false; }
  /// Whether this client has ended the session.
  virtual bool ends_session() const { return false; }
};

}  // namespace limn::session
