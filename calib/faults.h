#pragma once

#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

struct DeviceQuality;
struct HeldOut;

/// Something wrong with a capture that a person can put right.
struct Fault {
  std::string name;      ///< stable, for programs: board_not_visible, little_tilt, …
  std::string evidence;  ///< with numbers
  std::string advice;
};

/// The faults that captures and their solution show.
std::vector<Fault> faults(const Observed& observed,
                          const Solution& solution,
                          const std::vector<DeviceQuality>& devices,
                          const HeldOut& held_out);

}  // namespace limn::calib
