#pragma once

#include <algorithm>
#include <atomic>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/image_writer.h"
#include "device/camera_source.h"
#include "device/device_opener.h"
#include "device/devices_file.h"
#include "device/display.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/request.h"
#include "wizard/capture/still_board.h"
#include "wizard/capture/still_room.h"

namespace limn::wizard {

/// Real cameras and projectors as the wizard's backend. Displays must be opened with a latency of 0,
/// because the wizard measures it.
class DeviceBackend {
 public:
  struct Devices {
    std::vector<std::unique_ptr<device::CameraSource>> cameras;
    std::vector<std::unique_ptr<device::Display>> projectors;
    std::function<Stamp()> now;                ///< the cameras' clock
    std::function<void(double seconds)> wait;  ///< waits this long on that clock
    std::vector<std::string> infrared = {};    ///< names of the cameras that see no projected light
  };
  /// `wish`: a person's request, which ends the wait for a board; may be null.
  DeviceBackend(Devices devices, const calib::Board& board, std::atomic<WizardWish>* wish);

  /// They refer to this object, which must not move or end before them. Images go to `writer`.
  WizardBackend backend(ImageWriter* writer);

 private:
  Status wait_for_board(const WizardBackend::OnImage& on_image);
  Result<bool> wait_for_prototype(const WizardBackend::OnImage& on_image);
  Status show_all(const std::vector<cv::Mat>& images);
  Status show(std::size_t projector, const cv::Mat& image);
  Status light_all(int level);
  Result<cv::Mat> grab(std::size_t camera);
  Result<Frame> next(std::size_t camera);

  Devices devices_;
  calib::Board board_;
  std::atomic<WizardWish>* wish_;
  std::vector<double> latency_s_;  // latency of each projector
  std::vector<bool> is_black_;
  std::vector<StillBoard> boards_;  // for each camera
  std::vector<Stamp> captured_at_;  // stamp of each camera's newest frame
  std::vector<double> period_s_;    // frame period of each camera
  Stamp lit_at_;                    // when the images shown last are on the surface
};

/// Opens the cameras and projectors of a devices file. Error: one does not work, or there is not at
/// least one of each.
Result<DeviceBackend::Devices> open_devices(const device::Devices& named, device::DeviceOpener* opener);

/// The devices' names and sizes, as captures list them. `infrared`: the names of those that see no projected
/// light.
template <typename AllDevices>
std::vector<calib::CapturedDevice> captured_devices(const AllDevices& all,
                                                    std::span<const std::string> infrared = {}) {
  std::vector<calib::CapturedDevice> list;
  for (const auto& device : all) {
    list.push_back({device->name(), device->size().width, device->size().height});
    if (std::ranges::find(infrared, device->name()) != infrared.end()) list.back().sees = Spectrum::infrared;
  }
  return list;
}

}  // namespace limn::wizard
