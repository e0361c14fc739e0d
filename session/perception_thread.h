#pragma once

#include <atomic>
#include <chrono>
#include <optional>
#include <thread>

#include "core/latest.h"
#include "session/camera_threads.h"
#include "session/device_health.h"
#include "session/frame_loop.h"
#include "session/perception.h"
#include "session/recording.h"

namespace limn::session {

/// Runs perception on a thread of its own and keeps the newest percepts for take(). Control uses of percepts
/// that were not taken are kept.
class PerceptionThread {
 public:
  /// Starts at once. Borrows all arguments; `recorder` and `feeds` may be null.
  PerceptionThread(Perception* perception,
                   CameraThreads* cameras,
                   Recorder* recorder,
                   PoseFeeds* feeds,
                   DeviceHealth* health);
  ~PerceptionThread() { stop(); }

  /// The newest percepts that were not taken yet; waits up to `wait` for them.
  Perceived take_percepts(std::chrono::nanoseconds wait);

  /// Between stop() and start() the perception object may be replaced.
  void start();
  void stop();

 private:
  struct Seen {
    Percepts percepts;
    std::size_t moments = 0;
  };
  void run();

  Perception* perception_;
  CameraThreads* cameras_;
  Recorder* recorder_;
  PoseFeeds* feeds_;
  DeviceHealth* health_;
  std::size_t moments_ = 0;  // used by the thread only
  Latest<Seen> seen_;
  std::atomic<bool> is_stopping_ = false;
  std::thread thread_;
};

}  // namespace limn::session
