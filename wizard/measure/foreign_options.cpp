#include "wizard/measure/foreign_options.h"

#include "calib/foreign_phase.h"
#include "wizard/measure/pixel_size.h"

namespace limn::wizard {
namespace {

// A board that nobody has, for scans whose images show none.
constexpr const char* k_no_board = "charuco:30x30:1mm";

Result<calib::PhaseSeries> phase_series_of(const ForeignOptions& foreign) {
  LIMN_TRY(const calib::KnownOrder known, calib::KnownOrder::parse(foreign.order));
  using enum calib::WhitePlace;
  calib::PhaseSeries series;
  series.steps = foreign.steps;
  series.column_periods = foreign.periods;
  series.row_periods = foreign.row_periods;
  series.is_cued = foreign.is_cued;
  series.cue_inverses = known.inverses.value_or(calib::InversePlace::none);
  series.axes = known.axes.value_or(calib::AxisOrder::columns_rows);
  const std::string white = known.white.value_or("white-last");
  series.white = white == "white-first"   ? white_black_first
                 : white == "black-first" ? black_white_first
                 : white == "no-white"    ? absent
                                          : white_black_last;
  series.wave = foreign.wave;
  series.is_backward = foreign.is_backward;
  const bool is_readable = series.cue_inverses != calib::InversePlace::behind &&
                           series.cue_inverses != calib::InversePlace::before &&
                           series.axes != calib::AxisOrder::columns &&
                           series.axes != calib::AxisOrder::rows && !known.finest_first.value_or(false);
  if (!is_readable)
    return usage_error(
        "--order {}: with --import phase expected columns-first or rows-first, inverse-second, inverse-first "
        "or "
        "no-inverses for the cue, and white-first, black-first, white-last or no-white.",
        foreign.order);
  return series;
}

Result<calib::CaptureSet> foreign_captures(const std::filesystem::path& folder,
                                           const std::vector<std::string>& skip_poses,
                                           const ForeignOptions& foreign,
                                           bool needs_board) {
  const std::string format = k_import_formats.text(*foreign.import_format);
  if (foreign.projector.empty() || (needs_board && foreign.board.empty()))
    return usage_error("--import {}: needs --projector 1024x768{}.", format,
                       needs_board ? " and --board chessboard:9x7:75mm" : "");
  LIMN_TRY(const PixelSize size, parse_pixel_size(foreign.projector));
  const auto board = calib::Board::parse(foreign.board.empty() ? k_no_board : foreign.board);
  if (!board) return usage_error("--board: {}", board.message());
  if (foreign.import_format == ImportFormat::phase) {
    LIMN_TRY(const calib::PhaseSeries series, phase_series_of(foreign));
    return calib::import_phase(
        {folder, size.width, size.height, *board, foreign.poses, foreign.shots, skip_poses, series});
  }
  return calib::import_opencv_gray({folder, size.width, size.height, *board, foreign.poses, foreign.shots,
                                    skip_poses, foreign.order, foreign.step_px});
}

}  // namespace

Result<calib::CaptureSet> captures_of(const std::filesystem::path& folder,
                                      const std::vector<std::string>& skip_poses,
                                      const ForeignOptions& foreign,
                                      bool needs_board) {
  if (foreign.import_format) return foreign_captures(folder, skip_poses, foreign, needs_board);
  if (!foreign.projector.empty() || !foreign.board.empty() || !foreign.order.empty() || foreign.step_px != 0)
    return usage_error(
        "--projector, --board, --order and --step describe captures of other programs: they need --import "
        "opencv-gray.");
  return calib::load_captures(folder, skip_poses);
}

}  // namespace limn::wizard
