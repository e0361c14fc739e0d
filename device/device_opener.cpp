#include "device/device_opener.h"

namespace limn::device {
namespace {

Status check_is_here(const std::string& name, const std::string& host) {
  if (host.empty()) return {};
  return error(
      "{}: expected --room, because this device is plugged into the machine {}, found none. Name the room, "
      "or remove "
      "the device's host.",
      name, host);
}

}  // namespace

Result<std::unique_ptr<Display>> LocalOpener::display(const DisplayConfig& config) {
  LIMN_TRY_STATUS(check_is_here(config.name, config.host));
  return open_display(config, desktop_);
}

Result<std::unique_ptr<CameraSource>> LocalOpener::camera(const CameraConfig& config) {
  LIMN_TRY_STATUS(check_is_here(config.name, config.host));
  return open_camera(config);
}

}  // namespace limn::device
