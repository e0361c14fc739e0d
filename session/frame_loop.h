#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <set>
#include <vector>

#include "core/result.h"
#include "session/device_health.h"
#include "session/frame_input.h"
#include "session/perception.h"
#include "session/recalibration_stage.h"
#include "session/session.h"
#include "session/session_client.h"
#include "session/session_output.h"

namespace limn::apps {

/// What every session consists of, wherever it takes place.
struct SessionParts {
  Perception& perception;
  Session& session;
  SessionOutput& output;
  std::vector<SessionClient*> clients = {};  ///< in the order in which they are heard and told
};

/// The time that a session goes by: of the machine, of the virtual rig, or of a recording.
class FrameClock {
 public:
  virtual ~FrameClock() = default;
  virtual Stamp now() const = 0;
  /// The moments of the frame that comes next; nullopt: no image is due yet. Error: the session cannot go on.
  virtual Result<std::optional<FrameTimes>> next_frame() = 0;
};

/// What is new from the cameras.
struct Perceived {
  std::optional<Percepts> watched;  ///< nullopt: nothing is
  std::size_t moments = 0;          ///< calls of Watcher::watch so far
  int missed = 0;                   ///< camera frames that never came or were not looked at
  double record_ms = 0;             ///< what it cost to hand the frames to the recording
};

/// Where perceptions, and edits that nobody sends, come from: cameras, a virtual room with its script, or a
/// recording.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// Nothing more will come.
  virtual bool is_over() const = 0;
  /// The newest perception that was not taken yet; may wait for one for a moment.
  virtual Result<Perceived> perceive() = 0;
  /// Changes the session as a script or a recording says.
  virtual Status edit(Session*) { return {}; }
};

/// Where images go: projectors and screens, or a comparison with a recording.
class FrameSink {
 public:
  virtual ~FrameSink() = default;
  /// Shows `light`, an image a projector: what was painted, and what clients have drawn over it. Error: the
  /// session cannot go on.
  virtual Status show(const ComposedFrame& painted, const std::vector<cv::Mat>& light) = 0;
  /// Which images show_screens() wants of this frame.
  virtual std::set<scene::Screen> wanted_screens() const { return {}; }
  virtual void show_screens(const std::map<scene::Screen, cv::Mat>&) {}
  /// How far parts are from their true places, mm; -1: nobody knows.
  virtual double placement_mm(const ComposedFrame&) const { return -1; }
};

/// Where a session takes place. What differs between devices, the virtual rig and a replay is all in here.
struct FrameSetting {
  FrameClock& clock;
  FrameSource& source;
  FrameSink& sink;
  DeviceHealth& health;
  CaptureDevices* capture = nullptr;  ///< null: nobody can recalibrate here
};

/// The frame loop: what happens in a session, in which order.
class FrameLoop {
 public:
  FrameLoop(SessionParts parts, FrameSetting setting);

  /// Plays frames until the source is over, `is_ended`, or a client ends the session. `after_each` may be
  /// empty.
  Status run(const std::atomic<bool>& is_ended, const std::function<void()>& after_each = {});
  /// One frame. False: a client ended the session.
  Result<bool> step();

 private:
  void hear_clients();
  bool tell_clients(const ShownFrame* shown, const cv::Mat& screen);
  std::vector<Overlay> client_overlays();
  std::map<scene::Screen, cv::Mat> screen_images();
  void note_devices();

  SessionParts parts_;
  FrameSetting setting_;
  RecalibrationStage recalibration_;
};

}  // namespace limn::apps
