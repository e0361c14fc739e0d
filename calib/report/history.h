#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"
#include "core/rig.h"

namespace limn::calib {

/// How far a device stands from where an earlier calibration saw it, both as seen from camera 0.
struct DeviceMove {
  std::string name;
  double degrees = 0;
  double mm = 0;
  /// Median shift of the pixels at which the device sees this calibration's points. A lens's centre trades
  /// with its rotation: degrees that leave the pixels where they were moved nothing.
  double px = 0;
};

/// The key numbers of a calibration, as later ones of the same rig remember it.
struct PastCalibration {
  std::string made_at;  ///< ISO 8601, UTC; empty when it is not known
  std::string verdict;
  double held_out_px = 0;
  double worst_px = 0;
  double predicted_mm = 0;   ///< infinite when it was not known
  std::vector<DeviceMove> moved;  ///< against the one before it; empty for the first
};

/// What a rig folder remembers.
struct History {
  std::vector<PastCalibration> past;  ///< oldest first, at most k_history
  std::optional<Rig> rig;             ///< of the last one
};
constexpr int k_history = 20;  // a rig that is calibrated daily: a month; some 300 bytes each

/// Reads report.json and rig.json of an earlier calibration; without one, or when it cannot be read (it is
/// about to be replaced), the history is empty.
History read_history(const std::filesystem::path& folder);

/// Each device of `solution` that the earlier rig had, by name and size, too; camera 0 is where all is seen
/// from and not listed.
std::vector<DeviceMove> device_moves(const Rig& earlier, const Observations& observations, const Solution& solution);

}  // namespace limn::calib
