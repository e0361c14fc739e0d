#include "validate/hardware_report/plugged_in.h"

#include "device/desktop.h"
#include "device/v4l2_camera.h"

namespace limn::validate {

PluggedIn find_plugged_in() {
  PluggedIn found;
  for (const device::V4l2Device& camera : device::v4l2_cameras())
    if (camera.problem.empty()) found.cameras.push_back("v4l2:" + camera.path);
  const auto desktop = device::Desktop::open();
  if (!desktop) {
    found.no_monitor = desktop.message();
    return found;
  }
  for (const device::Monitor& monitor : desktop->monitors()) found.monitors.push_back(monitor.name);
  if (found.monitors.empty()) found.no_monitor = "The desktop has no monitor.";
  return found;
}

}  // namespace limn::validate
