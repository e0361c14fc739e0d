#pragma once

#include <string>
#include <vector>

namespace limn::validate {

/// What is plugged into this machine.
struct PluggedIn {
  std::vector<std::string> cameras;   ///< as sources of a devices file: v4l2:/dev/video0
  std::vector<std::string> monitors;  ///< names of the desktop's outputs
  std::string no_monitor = {};        ///< why there is none; empty: there is one
};

PluggedIn find_plugged_in();

}  // namespace limn::validate
