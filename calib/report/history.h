#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"
#include "core/rig.h"

namespace limn::calib {

/// The change of a device's pose since an earlier calibration, both relative to camera 0.
struct DeviceMove {
  std::string name;
  double degrees = 0;
  double mm = 0;
  /// Median shift of the pixels at which the device sees this calibration's points. A lens's principal point
  /// trades with its rotation: a rotation that leaves the pixels where they were is no movement.
  double px = 0;
};

/// The key numbers of a calibration that later calibrations of the same rig keep.
struct PastCalibration {
  std::string made_at;  ///< ISO 8601, UTC; empty when it is not known
  std::string verdict;
  double held_out_px = 0;
  double worst_px = 0;
  double predicted_mm = 0;        ///< infinite when it was not known
  std::vector<DeviceMove> moved;  ///< since the calibration before; empty for the first
};

/// The history of a rig folder.
struct History {
  std::vector<PastCalibration> past;  ///< oldest first, at most k_history
  std::optional<Rig> rig;             ///< rig of the last calibration
};
constexpr int k_history = 20;  // about a month of daily calibrations; some 300 bytes each

/// Reads report.json and rig.json of an earlier calibration. The history is empty when there is none, or when
/// it cannot be read (the files are about to be replaced).
History read_history(const std::filesystem::path& folder);

/// Moves of each device of `solution` that the earlier rig had, with the same name and size. Camera 0 is not
/// listed, because it is the reference.
std::vector<DeviceMove> device_moves(const Rig& earlier,
                                     const Observations& observations,
                                     const Solution& solution);

}  // namespace limn::calib
