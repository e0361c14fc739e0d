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
#include "tracker/cameras/detection_source.h"

namespace limn::session {

/// Frames by the name of their camera.
using Frames = std::map<std::string, Frame>;

/// What cameras have sent: frames, and of tracker::DetectionSources detections and some images.
struct CameraOutput {
  Frames frames = {}, images = {};
  std::map<std::string, tracker::CameraDetections> detections = {};
};

/// Runs one thread for each camera of a session. It reads the camera's frames and converts their stamps to
/// the session's clock. Only the newest frame of each camera is kept until take(); older ones are dropped and
/// counted.
class CameraThreads {
 public:
  explicit CameraThreads(std::shared_ptr<DeviceHealth> health);
  /// Takes no longer than k_patience. A camera whose driver has not returned by then (the search for a lost
  /// camera can take many seconds) is abandoned with its thread, with a warning in the log.
  ~CameraThreads();

  static constexpr std::chrono::milliseconds k_patience{500};

  /// `number`: the camera's number in `health`.
  void add(std::unique_ptr<device::CameraSource> camera, std::size_t number);

  /// The newest output that was not taken yet; waits up to `wait` for some.
  std::optional<CameraOutput> take_output(std::chrono::nanoseconds wait);
  /// tracker::DetectionSource::want_images(), if the camera is one.
  void want_images(const std::string& camera, tracker::DetectionSource::Images images);
  /// Number of frames that were dropped since the last call.
  std::size_t missed();

 private:
  struct Shared;
  struct Running {
    std::string camera;
    std::weak_ptr<device::CameraSource> source;
    std::thread thread;
    std::future<void> ended;
  };
  static void grab(device::CameraSource* camera, std::size_t number, Shared* shared);
  static void receive(tracker::DetectionSource* camera, std::size_t number, Shared* shared);

  std::shared_ptr<Shared> shared_;  // shared with abandoned threads
  std::vector<Running> running_;
};

}  // namespace limn::session
