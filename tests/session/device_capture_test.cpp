#include "session/device_capture.h"

#include <gtest/gtest.h>

#include <memory>
#include <opencv2/core.hpp>
#include <thread>

#include "device/offscreen_display.h"

namespace limn::session {
namespace {

const cv::Size k_size(64, 48);

// Delivers an image each 5 ms.
class SteadyCamera final : public device::CameraSource {
 public:
  const std::string& name() const override { return name_; }
  cv::Size size() const override { return k_size; }
  Result<Frame> next() override {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    Frame frame;
    frame.camera = name_;
    frame.image = cv::Mat(k_size, CV_8UC1, cv::Scalar(100));
    frame.captured_at = now();
    return frame;
  }

 private:
  std::string name_ = "camera0";
};

// How long after an image was shown the first photograph of it is taken.
double waited_s(double stated_s, double measured_s) {
  SessionDevices devices;
  devices.projectors.push_back(std::make_unique<device::OffscreenDisplay>("projector0", k_size, stated_s));
  devices.latency_s = {stated_s};
  const auto health = std::make_shared<DeviceHealth>();
  CameraThreads cameras(health);
  cameras.add(std::make_unique<SteadyCamera>(), health->add({"camera0", "camera"}));
  Rig rig;
  rig.cameras.resize(1);
  rig.cameras[0].name = "camera0";
  rig.projectors.resize(1);
  rig.projectors[0].name = "projector0";
  const std::atomic<bool> is_ended = false;
  DeviceCapture capture(&devices, &cameras, nullptr, rig, is_ended);
  wizard::WizardBackend backend = capture.backend(nullptr);
  backend.use_latency(0, measured_s);
  const Stamp begun = now();
  EXPECT_TRUE(backend.capture.show(0, cv::Mat(k_size, CV_8UC1, cv::Scalar(255))));
  EXPECT_TRUE(backend.capture.grab(0));
  return seconds_between(begun, now());
}

TEST(DeviceCapture, WaitsForTheMeasuredLatencyOnceWhateverTheDevicesFileStates) {
  for (const double stated_s : {0.0, 0.2, 0.3}) {
    const double took_s = waited_s(stated_s, 0.3);
    EXPECT_GE(took_s, 0.3) << stated_s;
    EXPECT_LT(took_s, 0.45) << stated_s;  // waited for twice: 0.5 and more
  }
  EXPECT_GE(waited_s(0.3, 0.1), 0.3);  // what the file states counts where less was measured
}

}  // namespace
}  // namespace limn::session
