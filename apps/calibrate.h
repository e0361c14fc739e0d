#pragma once

#include <filesystem>
#include <string>

#include "apps/room.h"
#include "calib/code/patterns.h"
#include "core/result.h"
#include "device/desktop.h"
#include "wizard/capture/device_backend.h"

namespace limn::apps {

struct CalibrateOptions {
  std::filesystem::path plan = {};                     ///< Plan of a virtual rig (limn.plan/1).
  std::filesystem::path devices = {};                  ///< limn.devices/1, instead of a plan.
  RoomOptions room = {};                               ///< With devices: whose nodes have some of them.
  std::string board = {};                              ///< With devices: `charuco:11x8:25mm`.
  calib::PatternCode code = calib::PatternCode::gray;  ///< With devices.
  std::string board_measured = {};                     ///< The print's measured size, as for limn solve.
  std::filesystem::path out;                           ///< Rig folder; its captures/ keeps every image.
  std::filesystem::path scene =
      {};             ///< Scene with the prototype's CAD mesh; with a plan the default is its world's scene.
  bool scan = false;  ///< Scan the prototype at the end and project colours that show how far light is off.
  bool all = false;   ///< Capture every pose of the plan, even if fewer are enough.
  bool terminal = false;  ///< Lines in the terminal instead of a window.
  bool json = false;      ///< Prints one JSON at the end; lines go to stderr, no window opens.
};

/// `limn calibrate`: on the virtual rig of the plan's world, or on devices. Runs in a window if there is a
/// display and neither `terminal` nor `json` is set.
Status run_calibrate(const CalibrateOptions& options);

/// `limn calibrate` on devices that are already open (`options.devices` is not read), in a window of
/// `desktop` under the same conditions as run_calibrate(). The displays are used by the calling thread alone.
Status calibrate_on(const CalibrateOptions& options,
                    wizard::DeviceBackend::Devices devices,
                    const Result<device::Desktop>& desktop);

}  // namespace limn::apps
