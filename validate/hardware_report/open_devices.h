#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "calib/capture_set.h"
#include "device/desktop.h"
#include "device/device_opener.h"
#include "device/devices_file.h"
#include "wizard/capture/backend.h"

namespace limn::validate {

/// Makes what opens devices; `desktop` may be null.
using OpenerFor = std::function<std::unique_ptr<device::DeviceOpener>(const device::Desktop* desktop)>;
/// Opens the devices of this machine.
std::unique_ptr<device::DeviceOpener> opener_here(const device::Desktop* desktop);

/// The devices of a report, on this machine or on the virtual rig, open while they are measured. Ctrl-C ends
/// a wait for an image.
class OpenDevices {
 public:
  /// Opens real devices. `captures` is the folder of the captures to come. Error: a device does not work, or
  /// the board is none.
  static Result<std::unique_ptr<OpenDevices>> open(const device::Devices& named,
                                                   const std::string& board,
                                                   const std::filesystem::path& captures,
                                                   const OpenerFor& opener);
  /// The virtual rig of config/plans/bench.json.
  static Result<std::unique_ptr<OpenDevices>> open_virtual(const std::filesystem::path& captures);
  ~OpenDevices();

  const calib::CaptureSet& captures() const;
  const wizard::WizardBackend& backend() const;
  /// What the cameras report, by their names; null on the virtual rig.
  const nlohmann::ordered_json& settings() const;

 private:
  struct Impl;
  explicit OpenDevices(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::validate
