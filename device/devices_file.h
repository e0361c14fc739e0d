#pragma once

#include <filesystem>
#include <vector>

#include "core/result.h"
#include "core/rig.h"
#include "device/key_source.h"
#include "device/open_camera.h"
#include "device/open_display.h"

namespace limn::apps {

/// The cameras, displays and keys of a place (limn.devices/1).
struct Devices {
  std::filesystem::path file;
  std::vector<device::CameraConfig> cameras;
  std::vector<device::DisplayConfig> displays;
  std::vector<device::KeysConfig> keys = {};
};

/// Reads a devices file; paths of images and videos are relative to its folder. Errors name the place:
/// unknown or missing keys, a name used twice, two cameras of one source, two displays on one monitor.
Result<Devices> load_devices(const std::filesystem::path& path);

/// The devices with the sizes of the rig's imagers of their names, so that opening them refuses others.
/// Error: names of either that the other has not, or a size in the file that is not the rig's. Displays
/// beyond the rig's projectors (a large screen) are left as they are.
Result<Devices> matched(const Devices& devices, const Rig& rig);

}  // namespace limn::apps
