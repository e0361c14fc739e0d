#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/rig.h"
#include "device/key_source.h"
#include "device/open_camera.h"
#include "device/open_display.h"

namespace limn::device {

/// The cameras, displays and keys of an installation (limn.devices/1).
struct Devices {
  std::filesystem::path file = {};
  std::vector<device::CameraConfig> cameras = {};
  std::vector<device::DisplayConfig> displays = {};
  std::vector<device::KeysConfig> keys = {};
};

/// Reads a devices file; paths of images and videos are relative to its folder. Errors name the key: unknown
/// or missing keys, a name used twice, two cameras with one source, two displays on one monitor.
Result<Devices> load_devices(const std::filesystem::path& path);

/// Reads the text of a devices file that another machine sent; `from` names it in messages. Paths of images
/// and videos are relative to `folder`.
Result<Devices> parse_devices(const std::string& text,
                              const std::string& from,
                              const std::filesystem::path& folder);
/// The cameras and displays as such a text. A screen's wall is left out.
std::string devices_text(std::span<const CameraConfig> cameras, std::span<const DisplayConfig> displays);

/// The devices with the image sizes of the rig's imagers of the same names, so that opening them refuses
/// other sizes. Error: a camera without an imager in the rig, an imager without a device, or a size in the
/// file that differs from the rig's. Displays that are not projectors of the rig (a large screen) do not
/// change.
Result<Devices> matched(const Devices& devices, const Rig& rig);

}  // namespace limn::device
