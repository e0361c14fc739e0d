#pragma once

#include <chrono>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/frame.h"
#include "device/camera_source.h"
#include "session/device_health.h"

namespace limn::apps {

/// By camera.
using Frames = std::map<std::string, Frame>;

/// A thread for each camera of a session, which takes its frames and puts them on the session's clock. The
/// newest of each waits for whoever asks; older ones are dropped and counted.
class CameraThreads {
 public:
  explicit CameraThreads(std::shared_ptr<DeviceHealth> health);
  /// Takes no longer than k_patience: a camera that does not come back from its driver by then (one that was
  /// lost may be searched for for many seconds) is left behind with its thread, and that is told.
  ~CameraThreads();

  static constexpr std::chrono::milliseconds k_patience{500};

  /// `number`: as `health` calls it.
  void add(std::unique_ptr<device::CameraSource> camera, std::size_t number);

  /// The newest frames that were not taken yet; waits for one for so long.
  std::optional<Frames> take(std::chrono::nanoseconds wait);
  /// Frames that were dropped since the last call.
  std::size_t missed();

 private:
  struct Shared;
  struct Running {
    std::string camera;
    std::thread thread;
    std::future<void> ended;
  };
  static void grab(device::CameraSource* camera, std::size_t number, Shared* shared);

  std::shared_ptr<Shared> shared_;  // with threads that are left behind
  std::vector<Running> running_;
};

}  // namespace limn::apps
