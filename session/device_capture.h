#pragma once

#include <atomic>
#include <map>
#include <string>
#include <vector>

#include "core/rig.h"
#include "session/camera_threads.h"
#include "session/capture_stage.h"
#include "session/device_session.h"
#include "session/perception_thread.h"

namespace limn::session {

/// Gives captures of a session access to the cameras and displays of a session on devices. The session shows
/// frames again while the result is computed.
class DeviceCapture final : public CaptureDevices {
 public:
  /// Borrows all of them except `rig`, which gives the names and the order of the devices.
  DeviceCapture(SessionDevices* devices,
                CameraThreads* cameras,
                PerceptionThread* perception,
                const Rig& rig,
                const std::atomic<bool>& is_ended);

  wizard::WizardBackend backend(ImageWriter* writer) override;
  void pause_perception(Session* session) override;
  void resume_perception() override;
  bool waits_for_result() const override { return false; }

 private:
  // A camera's newest image.
  struct Grabbed {
    Frame frame;
    double period_s;
  };
  Status show_pattern(std::size_t projector, const cv::Mat& image);
  Result<cv::Mat> grab(const std::string& camera);

  SessionDevices* devices_;
  CameraThreads* cameras_;
  PerceptionThread* perception_;
  std::vector<std::string> camera_names_, projector_names_;
  const std::atomic<bool>& is_ended_;
  std::map<std::string, Grabbed> grabbed_;
  std::vector<double> latency_s_;  // one per projector
  Stamp on_surface_at_;            // when the light of the last pattern is on the surface
};

}  // namespace limn::session
