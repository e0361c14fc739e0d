#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct DoctorOptions {
  std::filesystem::path devices =
      {};                          ///< devices file (limn.devices/1) whose cameras and displays are tested
  std::filesystem::path rig = {};  ///< rig that they must belong to
  double show_s = 0;               ///< how long each output shows its own number and colour
  bool json = false;               ///< print JSON instead of lines
  /// Where the packages are listed, and which are installed (Debian's own file).
  std::filesystem::path packages = {};
  std::filesystem::path installed = "/var/lib/dpkg/status";
};

/// One thing that was looked at.
struct Finding {
  enum class State { works, fails, note };  ///< a note is nothing that was asked for
  std::string area;                         ///< packages, clock, gl, displays, cameras, devices
  std::string name;
  State state = State::works;
  std::string text;
  std::string advice;  ///< what to do; empty where nothing is to be done
};

/// Looks at packages, clock, OpenGL, displays, cameras, and at the devices of the file; opens them and grabs
/// frames. Without X and without a camera that is noted, unless the file or --show asks for them.
std::vector<Finding> examined(const DoctorOptions& options);

/// `limn doctor`: as examined(), printed. Error when something that was asked for does not work.
Status run_doctor(const DoctorOptions& options);

}  // namespace limn::apps
