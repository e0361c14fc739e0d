#pragma once

#include <filesystem>
#include <string>

#include "core/result.h"
#include "device/desktop.h"
#include "wizard/capture/device_backend.h"

namespace limn::apps {

struct CalibrateOptions {
  std::filesystem::path plan = {};     ///< of a virtual rig
  std::filesystem::path devices = {};  ///< limn.devices/1, instead of a plan
  std::string board = {};              ///< with devices: `charuco:11x8:25mm`
  std::string code = "gray";           ///< with devices
  std::filesystem::path out;           ///< the rig folder; its captures/ keeps every image
  std::filesystem::path scene = {};    ///< of the prototype; with a plan its world's
  bool scan = false;                   ///< scan the prototype at the end, and paint it
  bool all = false;                    ///< take every pose of the plan, although fewer are enough
  bool terminal = false;               ///< lines instead of a window
  bool json = false;  ///< print one JSON at the end; the lines go to stderr, there is no window
};

/// `limn calibrate`: on the virtual rig of the plan's world, or on devices; in a window where a display is
/// there and neither `terminal` nor `json` is asked for.
Status run_calibrate(const CalibrateOptions& options);

/// `limn calibrate` on devices that are open (of `options` devices is not read); in a window of `desktop`, as
/// run_calibrate() does it. The displays are used by the calling thread alone.
Status calibrate_on(const CalibrateOptions& options,
                    DeviceBackend::Devices devices,
                    const Result<device::Desktop>& desktop);

}  // namespace limn::apps
