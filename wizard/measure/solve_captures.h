#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/report/report.h"
#include "core/result.h"
#include "core/stage.h"
#include "wizard/measure/foreign_options.h"

namespace limn::wizard {

struct SolveCommandOptions {
  std::filesystem::path captures;
  std::filesystem::path out;
  std::vector<std::string> skip_poses = {};  ///< names of poses to leave out
  /// Lens model of all cameras, and of all projectors; "auto": selected for each device by held-out error.
  std::string camera_model = "auto";
  std::string projector_model = "auto";
  bool cameras_only = false;    ///< solves the cameras from photographs of the board, without projectors
  ForeignOptions foreign = {};  ///< describes captures of another program, and photographs of cameras alone
  /// Scale bars that the cameras see, each as "apriltag_36h11:3 apriltag_36h11:7 250mm", in addition to those
  /// of capture.json.
  std::vector<std::string> scale_bar_lengths = {};
  /// Families of the markers that stand on the prototype, or anywhere but on the board: with several cameras
  /// their corners are tie points. The scale bars' families count, too.
  std::vector<std::string> families = {"apriltag_36h11"};
  /// The print's measured size, as calib/board_print.h reads it; empty: that of capture.json, if any.
  std::string board_measured = {};
  /// Cameras' pixels may be not square (images that were stretched), so that no print is found to be uneven.
  bool pixels_not_square = false;
  /// Stages: images, response, decode, solve, assess, write; of cameras alone: decode, solve, assess, write.
  ReportStage report_stage = {};
};

/// The print's measured size: that of the text (calib/board_print.h), else that of the captures, else none.
/// Errors: lengths that are not this board's, lengths of a board whose text says that it is exact.
Result<std::optional<calib::BoardMeasured>> measured_board(const calib::CaptureSet& captures,
                                                           const std::string& text);

/// Solves captures and writes the rig folder (rig.json, .cameramodel files, report.json, report.html,
/// observations.json). If the solve fails, at most report.json is written, with the faults that explain it.
Result<calib::Report> solve_captures(const SolveCommandOptions& options);

}  // namespace limn::wizard
