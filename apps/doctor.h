#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/room.h"
#include "core/result.h"
#include "validate/hardware_report/report.h"

namespace limn::apps {

struct DoctorOptions {
  /// Devices file (limn.devices/1) whose cameras and displays are tested.
  std::filesystem::path devices = {};
  std::filesystem::path rig = {};  ///< Rig that the devices must match.
  double show_s = 0;               ///< How long each output shows its own number and colour.
  RoomOptions room = {};           ///< A room whose machines are listed.
  bool json = false;               ///< Prints JSON instead of lines.
  /// List of the packages needed, Debian's own file of installed packages, and the file that names its
  /// release.
  std::filesystem::path packages = {};
  std::filesystem::path installed = "/var/lib/dpkg/status";
  std::filesystem::path release = "/etc/os-release";
};

using validate::Finding;

/// Tests packages, clock, OpenGL, displays, cameras, and the devices of the file: opens them and grabs
/// frames. A missing X display or camera is only a note, unless the file or --show asks for it.
std::vector<Finding> examined(const DoctorOptions& options);

/// `limn doctor`: prints the result of examined(). Error when something that was asked for does not work.
Status run_doctor(const DoctorOptions& options);

/// What run_hardware_report() (`limn doctor --report`) needs: these tests, and live sessions.
validate::ReportCommands report_commands();

}  // namespace limn::apps
