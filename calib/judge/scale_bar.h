#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/board_print.h"
#include "calib/capture_set.h"
#include "calib/detected_mark.h"
#include "calib/judge/faults.h"
#include "calib/solve.h"
#include "core/result.h"

namespace limn::calib {

/// A scale bar: a measured distance between the centres of two markers on one stiff object, such as a printed
/// bar; or the side of one marker's black square; or the mean of width and height of a second board, from its
/// first to its last inner corner. It is independent of the board, so it detects a board of a wrong size.
struct ScaleBar {
  std::string from, to;  ///< `family:id`; `to` is `from` for the side of one marker; a second board's text
  double length_m = 0;
  double stddev_m = 1e-4;  ///< standard deviation of the length
  std::optional<Board> board = {};
  bool is_side() const { return from == to; }
  std::string text() const;  ///< "A to B", "the side of A", "the board A"
};

/// "apriltag_36h11:3 apriltag_36h11:7 250mm:0.05", or "apriltag_36h11:3 40mm" for the side of one marker (mm,
/// cm or m; behind the colon its standard deviation in mm, 0.1 when absent), or a board's text, also with its
/// measured size behind it as parse_board_measured() reads it. A board that nobody measured is as uncertain
/// as a print, or exact.
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
  double calibration_m = 0;         ///< the devices' part of it, which all lengths share
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

/// By how much the board's print is larger than its text, as lengths show it that were measured with a rig in
/// which it is larger by `assumed`, without an error of its own. Lengths that differ from each other by more
/// than they state widen it. None: no length was seen.
std::optional<PrintGrowth> growth_by_lengths(const std::vector<ScaleBarCheck>& checks, double assumed);

/// Whether a print may differ so much from what is expected of it: a print that nobody measured by a
/// hundredth, others within their deviations and k_scale_tolerance.
bool may_be_growth(const PrintGrowth& expected, const PrintGrowth& found);

/// `wrong_scale` beyond 3 stated deviations and k_scale_tolerance; `known_length_not_seen` without a view.
/// Says what the rig's size rests on then, and why. `measured`: the board's size by hand; `is_used`: whether
/// the known lengths are part of the solve.
std::optional<Fault> scale_fault(const ScaleBarCheck& check,
                                 const Board& board,
                                 const std::optional<BoardMeasured>& measured,
                                 bool is_used);

/// A note where known lengths, which are part of the solve, show that the print is larger or smaller than its
/// text by more than 3 deviations and k_scale_tolerance.
std::optional<Fault> growth_note(const PrintGrowth& found, const Board& board);
constexpr double k_scale_tolerance = 0.002;  // a printer's own error is half of that

}  // namespace limn::calib
