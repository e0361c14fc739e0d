#pragma once

#include <atomic>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/result.h"
#include "session/capture_stage.h"
#include "session/device_health.h"
#include "session/frame_input.h"
#include "session/perception.h"
#include "session/pose_feeds.h"
#include "session/screen_request.h"
#include "session/session.h"
#include "session/session_client.h"
#include "session/session_output.h"

namespace limn::session {

/// The parts of every session: on devices, on a virtual rig, or in a replay.
struct SessionParts {
  Perception& perception;
  Session& session;
  SessionOutput& output;
  std::vector<SessionClient*> clients = {};  ///< in the order in which they are called
  PoseFeeds* feeds = nullptr;                ///< other tracking systems; null: none
};

/// The clock of a session: the machine's, the virtual rig's, or a recording's.
class FrameClock {
 public:
  virtual ~FrameClock() = default;
  virtual Stamp now() const = 0;
  /// The times of the next frame; nullopt: no frame is due yet. Error: the session cannot go on.
  virtual Result<std::optional<FrameTimes>> next_frame() = 0;
};

/// New percepts from the cameras.
struct Perceived {
  std::optional<Percepts> percepts;  ///< nullopt: nothing is new
  std::size_t moments = 0;           ///< number of calls of Perception::watch so far
  int missed = 0;                    ///< camera frames that never arrived or were not processed
  double record_ms = 0;              ///< time to pass the frames to the recording
};

/// Where percepts, and edits that no client sends, come from: cameras, a virtual room with its script, or a
/// recording.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// Whether nothing more will come.
  virtual bool is_over() const = 0;
  /// The newest percepts that were not taken yet; may wait a moment for them.
  virtual Result<Perceived> perceive() = 0;
  /// Applies the edits of a script or a recording.
  virtual Status edit(Session*) { return {}; }
};

/// Where images go: to projectors and screens, or into a comparison with a recording.
class FrameSink {
 public:
  virtual ~FrameSink() = default;
  /// Shows `light`, one image per projector: the composed images with the clients' overlays. Error: the
  /// session cannot go on.
  virtual Status show(const ComposedFrame& composed, const std::vector<EyeImages>& light) = 0;
  /// The projectors that give no light now; nullopt: a recording says it.
  virtual std::optional<std::vector<std::string>> dark_projectors() const { return std::nullopt; }
  /// The screen images that show_screens() needs for this frame.
  virtual std::vector<ScreenRequest> wanted_screens() const { return {}; }
  virtual void show_screens(std::span<const ScreenImages>) {}
  /// The shortest time between two images of the screen that are drawn for clients.
  virtual double screen_interval_s() const { return 0; }
  /// RMS distance of the parts from their true positions, mm; -1: unknown.
  virtual double placement_mm(const ComposedFrame&) const { return -1; }
};

/// Everything that differs between a session on devices, on the virtual rig, and in a replay.
struct FrameSetting {
  FrameClock& clock;
  FrameSource& source;
  FrameSink& sink;
  DeviceHealth& health;
  CaptureDevices* capture = nullptr;  ///< null: captures are not possible
};

/// The frame loop: states what happens in a session, in which order.
class FrameLoop {
 public:
  FrameLoop(SessionParts parts, FrameSetting setting);

  /// Runs frames until the source is over, `is_ended` is set, or a client ends the session. `after_each` may
  /// be empty.
  Status run(const std::atomic<bool>& is_ended, const std::function<void()>& after_each = {});
  /// Runs one frame. False: a client ended the session.
  Result<bool> step();

 private:
  void apply_client_edits();
  bool publish_to_clients(const ShownFrame* shown, const cv::Mat& screen);
  std::vector<projector::Overlay> client_overlays();
  std::vector<ScreenImages> screen_images();
  void note_devices();

  SessionParts parts_;
  FrameSetting setting_;
  CaptureStage captures_;
  std::optional<Stamp> client_screen_at_;  // when a screen's image was last drawn for clients
};

}  // namespace limn::session
