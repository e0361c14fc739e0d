#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "core/image_writer.h"
#include "device/camera_source.h"
#include "device/desktop.h"
#include "device/devices_file.h"
#include "device/display.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/request.h"
#include "wizard/capture/still_board.h"
#include "wizard/capture/still_room.h"

namespace limn::apps {

/// Cameras and projectors in a room as the wizard's surroundings. Displays must be opened without a latency
/// of their own: it is measured.
class DeviceBackend {
 public:
  struct Devices {
    std::vector<std::unique_ptr<device::CameraSource>> cameras;
    std::vector<std::unique_ptr<device::Display>> projectors;
    std::function<Stamp()> now;                ///< the cameras' clock
    std::function<void(double seconds)> wait;  ///< lets that clock go on
  };
  /// `wish`: any ends the waiting for a board; may be null.
  DeviceBackend(Devices devices, const calib::Board& board, std::atomic<WizardWish>* wish);

  /// This must stay where it is as long as they are used; images go to `writer`.
  Surroundings surroundings(ImageWriter* writer);

 private:
  Status hold(const Surroundings::Seen& seen);
  Result<bool> stand(const Surroundings::Seen& seen);
  Status paint(const std::vector<cv::Mat>& images);
  Status show(std::size_t projector, const cv::Mat& image);
  Status light_all(int level);
  Result<cv::Mat> grab(std::size_t camera);
  Result<Frame> next(std::size_t camera);

  Devices devices_;
  calib::Board board_;
  std::atomic<WizardWish>* wish_;
  std::vector<double> latency_s_;  // of the projectors
  std::vector<bool> is_black_;
  std::vector<StillBoard> boards_;  // as each camera sees it
  std::vector<Stamp> captured_at_;  // the newest frame of each camera
  std::vector<double> period_s_;    // of each camera's frames
  Stamp lit_at_;                    // what was shown last is on the surface
};

/// Cameras and projectors of a devices file; every one must work, and there must be some of both.
Result<DeviceBackend::Devices> opened_devices(const Devices& named, const Result<device::Desktop>& desktop);

/// As captures name them.
template <typename AllDevices>
std::vector<calib::CapturedDevice> captured_devices(const AllDevices& all) {
  std::vector<calib::CapturedDevice> list;
  for (const auto& device : all)
    list.push_back({device->name(), device->size().width, device->size().height});
  return list;
}

}  // namespace limn::apps
