#include "nodes/node_devices.h"

#include <opencv2/core.hpp>

#include "core/log.h"
#include "device/devices_file.h"
#include "device/gige_camera.h"
#include "device/v4l2_camera.h"
#include "nodes/ros_camera.h"

namespace limn::nodes {

std::vector<OfferedDevice> NodeDisplays::monitors() const {
  std::vector<OfferedDevice> out;
  if (desktop_)
    for (const device::Monitor& monitor : desktop_->monitors()) out.push_back({monitor.name, monitor.size});
  out.push_back({device::k_display_kinds.text(device::DisplayKind::offscreen), {}});
  return out;
}

std::vector<OfferedDevice> NodeCameras::found() {
  std::vector<OfferedDevice> out;
  for (const device::V4l2Device& found : device::v4l2_cameras())
    if (found.problem.empty()) out.push_back({"v4l2:" + found.path, {}});
  const auto on_network = device::gige_cameras();
  if (!on_network) log_warning("{}", on_network.message());
  if (on_network)
    for (const std::string& id : *on_network) out.push_back({"gige:" + id, {}});
  return out;
}

Result<device::Display*> NodeDisplays::display(const device::DisplayConfig& config) {
  std::unique_ptr<device::Display>& display = displays_[device::devices_text({}, {&config, 1})];
  if (!display) {
    LIMN_TRY(display, device::open_display(config, desktop_));
  }
  return display.get();
}

void NodeDisplays::darken() {
  for (const auto& [config, display] : displays_) {
    if (!display) continue;
    const auto shown_at = display->show(cv::Mat(display->size(), CV_8UC3, cv::Scalar::all(0)));
    if (!shown_at) log_warning("node: {}", shown_at.message());
  }
}

Result<device::CameraSource*> NodeCameras::camera(const device::CameraConfig& config) {
  std::unique_ptr<device::CameraSource>& camera = cameras_[device::devices_text({&config, 1}, {})];
  if (!camera) {
    LIMN_TRY(camera, open_camera_here(config));
  }
  return camera.get();
}

std::unique_ptr<device::CameraSource> NodeCameras::taken_out(const std::string& config) {
  auto camera = cameras_.extract(config);
  return camera ? std::move(camera.mapped()) : nullptr;
}

}  // namespace limn::nodes
