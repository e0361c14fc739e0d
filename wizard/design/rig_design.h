#pragma once

#include <string>
#include <vector>

#include "core/result.h"
#include "wizard/design/rig_description.h"

namespace limn::design {

/// An imager, and how it sees or lights the prototype's lit side in the middle of the volume.
struct PredictedImager {
  std::string name;
  double distance_m = 0;
  double pixel_mm = 0;    ///< size of a pixel on a surface that faces it
  double surface_mm = 0;  ///< longer side of a pixel on the lit side; infinite from behind
  double steep_deg = 0;   ///< angle between its ray and the lit side's normal
  double coverage = 0;    ///< share of the volume that lies in its image
  double lux = 0;         ///< illuminance of the lit side by a projector's white; 0: not known
};

/// A camera and a projector as a pair.
struct PredictedPair {
  std::string camera, projector;
  double angle_deg = 0;  ///< angle between their rays in the middle of the volume
  double coverage = 0;   ///< share of the volume that lies in both images
};

/// A camera and a marker on the lit side in the middle of the volume.
struct PredictedMarker {
  std::string camera;
  double side_px = 0;      ///< its shortest side in the image
  double farthest_px = 0;  ///< the same at the farthest point of the volume
  double across_mm = 0;  ///< 95 % position error across the view; the only one of a marker on a known surface
  double along_mm = 0;   ///< 95 % position error along the view
};

struct PredictedAccuracy {
  std::vector<PredictedImager> cameras, projectors;
  std::vector<PredictedPair> pairs;
  std::vector<PredictedMarker> markers;  ///< one for each camera that sees it
  /// For each projector, the 95 % error of its light on the surface as a calibration would state it
  /// (report.json's predicted_error_mm), and the parts of it that come from the calibration and from
  /// measuring the prototype's pose. Infinite where nothing is known.
  std::vector<double> error_mm, calibration_mm, measuring_mm;
  double coverage = 0;              ///< share of the volume that camera 0 and some projector reach
  std::vector<std::string> advice;  ///< from design_advice(); empty: nothing limits the rig
};

/// Simulates the calibration: simulated_observations(), then `calib::solve` and `calib::assess`. Room light,
/// defocus, a bent board and a lens that its model cannot represent are not included. The same file gives the
/// same numbers. Error: the solve's error.
Result<PredictedAccuracy> predict_accuracy(const DescribedRig& described);

}  // namespace limn::design
