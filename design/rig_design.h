#pragma once

#include <string>
#include <vector>

#include "core/result.h"
#include "design/rig_description.h"

namespace limn::apps {

/// An imager and the prototype's lit side in the middle of the volume.
struct PredictedImager {
  std::string name;
  double distance_m = 0;
  double pixel_mm = 0;    ///< of a surface that faces it
  double surface_mm = 0;  ///< of the lit side, along its steeper direction; infinite when it looks away
  double steep_deg = 0;   ///< between its ray and the lit side's normal
  double coverage = 0;    ///< share of the volume that it reaches
  double lux = 0;         ///< a projector's white on the lit side; 0: not known
};

/// A camera and a projector together.
struct PredictedPair {
  std::string camera, projector;
  double angle_deg = 0;  ///< between their rays in the middle of the volume
  double coverage = 0;   ///< share of the volume that both reach
};

/// A camera and a designer's marker on the lit side, in the middle of the volume: 95 % errors of its place.
struct PredictedMarker {
  std::string camera;
  double side_px = 0;      ///< across its steeper direction
  double farthest_px = 0;  ///< likewise, at the farthest corner of the volume
  double across_mm = 0;    ///< across the camera's view: what stays where a known surface carries it
  double along_mm = 0;     ///< along the view
};

struct PredictedAccuracy {
  std::vector<PredictedImager> cameras, projectors;
  std::vector<PredictedPair> pairs;
  std::vector<PredictedMarker> markers;  ///< of the cameras that see one
  /// For each projector: 95 % error of its light on the surface as a calibration would state it
  /// (report.json's predicted_error_mm); infinite where nothing is known. Of that, the calibration's part,
  /// and that of measuring where the prototype stands.
  std::vector<double> error_mm, calibration_mm, measuring_mm;
  double coverage = 0;              ///< share of the volume that camera 0 and a projector at least reach
  std::vector<std::string> advice;  ///< what limits, most hurtful first; empty: nothing
};

/// Plays the calibration: board placements all over the volume, what cameras and projectors would observe of
/// them with normal noise, `calib::solve` and `calib::assess` on that. Room light, defocus, a bending board
/// and a lens that its model does not hold are not in it. The same file gives the same numbers. Errors: no
/// solve, with what the solve says.
Result<PredictedAccuracy> predict_accuracy(const DescribedRig& described);

}  // namespace limn::apps
