#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/capture_set.h"
#include "calib/detected_mark.h"
#include "calib/judge/faults.h"
#include "calib/solve.h"
#include "core/result.h"

namespace limn::calib {

/// A scale bar: a measured distance between the centres of two markers on one stiff object, such as a printed
/// bar, or the side of one marker's black square. It is independent of the board, so it detects a board of a
/// wrong size.
struct ScaleBar {
  std::string from, to;  ///< `family:id`; `to` is `from` for the side of one marker
  double length_m = 0;
  bool is_side() const { return from == to; }
  std::string text() const;  ///< "A to B", "the side of A"
};

/// "apriltag_36h11:3 apriltag_36h11:7 250mm", or "apriltag_36h11:3 40mm" for the side of one marker (mm, cm
/// or m).
Result<ScaleBar> parse_scale_bar(const std::string& text);

/// The measurement by one camera and one projector in one pose.
struct ScaleBarView {
  int camera = 0;
  int projector = 0;
  int pose = 0;
  double measured_m = 0;
  double noise_m = 0;        ///< standard deviation by the decoding noise of this view
  double calibration_m = 0;  ///< standard deviation by the devices' covariance, common to all views
};

struct ScaleBarCheck {
  ScaleBar known;
  std::vector<ScaleBarView> views;  ///< empty: in no pose were both marks seen and illuminated
  double measured_m = 0;            ///< mean of the views, weighted by noise
  double stddev_m = 0;              ///< stated standard deviation of the mean, calibration included
};

/// Measures each scale bar with structured light: the paper in and around each mark is decoded and
/// triangulated from the camera's and the projector's rays, and a plane through these points is intersected
/// with the camera's ray of the mark's centre. Poses with or without a board are used. `widened`: factor on
/// the devices' standard deviations, such as the standard deviation of the held-out normalised residuals
/// where that is above 1.
Result<std::vector<ScaleBarCheck>> measure_scale_bars(const CaptureSet& captures,
                                                      const Solution& solution,
                                                      const std::vector<DetectedMark>& marks,
                                                      const std::vector<ScaleBar>& lengths,
                                                      double widened = 1);

/// `wrong_scale` beyond 3 stated deviations and k_scale_tolerance; `known_length_not_seen` without a view.
std::optional<Fault> scale_fault(const ScaleBarCheck& check, const Board& board);
constexpr double k_scale_tolerance = 0.002;  // a printer's own error is half of that

}  // namespace limn::calib
