#pragma once

#include <atomic>
#include <chrono>
#include <optional>
#include <thread>

#include "session/camera_threads.h"
#include "session/device_health.h"
#include "session/frame_loop.h"
#include "session/latest.h"
#include "session/perception.h"
#include "session/recording.h"

namespace limn::apps {

/// Perceives on a thread of its own what cameras see; the newest perception waits for whoever asks. Gestures
/// of those that nobody asked for are kept.
class PerceptionThread {
 public:
  /// Begins at once. Borrows all of them; `recorder` may be null.
  PerceptionThread(Perception* perception, CameraThreads* cameras, Recorder* recorder, DeviceHealth* health);
  ~PerceptionThread() { stop(); }

  /// The newest perception that was not taken yet; waits for one for so long.
  Perceived take(std::chrono::nanoseconds wait);

  /// Between stop() and start() the watcher is free to be replaced.
  void start();
  void stop();

 private:
  struct Seen {
    Percepts watched;
    std::size_t moments = 0;
  };
  void run();

  Perception* perception_;
  CameraThreads* cameras_;
  Recorder* recorder_;
  DeviceHealth* health_;
  std::size_t moments_ = 0;  // the thread's own
  Latest<Seen> seen_;
  std::atomic<bool> is_stopping_ = false;
  std::thread thread_;
};

}  // namespace limn::apps
