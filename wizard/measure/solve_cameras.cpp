#include "wizard/measure/solve_cameras.h"

#include <chrono>

#include "calib/board_views.h"
#include "calib/judge/assess.h"
#include "calib/model_selection.h"
#include "core/time_now.h"

namespace limn::wizard {
namespace {

using SteadyClock = std::chrono::steady_clock;

double seconds_after(SteadyClock::time_point begun) {
  return std::chrono::duration<double>(SteadyClock::now() - begun).count();
}

Result<calib::BoardViews> views_of(const SolveCommandOptions& options) {
  if (options.foreign.import_format || std::filesystem::exists(options.captures / "capture.json")) {
    LIMN_TRY(const calib::CaptureSet captures,
             captures_of(options.captures, options.skip_poses, options.foreign));
    return calib::board_views(captures);
  }
  if (options.foreign.board.empty())
    return usage_error(
        "--cameras-only: needs --board, such as --board chessboard:9x6:25mm, for photographs in {}.",
        options.captures.string());
  const auto board = calib::Board::parse(options.foreign.board);
  if (!board) return usage_error("--board: {}", board.message());
  LIMN_TRY(calib::ShotFiles shots, calib::find_photographs({options.captures, options.foreign.poses,
                                                            options.foreign.shots, options.skip_poses}));
  return calib::BoardViews{options.captures, *board, std::move(shots.cameras), std::move(shots.poses)};
}

}  // namespace

Result<calib::Report> solve_cameras(const SolveCommandOptions& options) {
  const auto begun = SteadyClock::now();
  LIMN_TRY(const calib::BoardViews views, views_of(options));
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "decode"}));
  LIMN_TRY(calib::Observed observed, calib::observe_board(views));
  const double board_seconds = observed.seconds_board;
  calib::SolveOptions solving;
  solving.camera_model = options.camera_model;
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "solve"}));
  const auto solving_begun = SteadyClock::now();
  LIMN_TRY(calib::ModelSelection choice, calib::solve_selecting_models(observed.observations, solving));
  const double solve_seconds = seconds_after(solving_begun);
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "assess"}));
  calib::Assessment assessment = calib::assess(observed, choice.solution, std::move(choice.held_out));
  calib::Report report{std::move(observed),
                       std::move(choice.solution),
                       std::move(assessment),
                       {{"board", board_seconds}, {"solve", solve_seconds}, {"total", seconds_after(begun)}},
                       std::move(choice.trials)};
  report.explanation = calib::explain(report.observed, report.solution, report.assessment,
                                      views.cameras.size() == 1 || views.board.is_exact);
  report.made_at = time_now();
  report.history = calib::read_history(options.out);
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "write"}));
  LIMN_TRY_STATUS(calib::write_rig_folder(report, choice.options, options.out));
  return report;
}

}  // namespace limn::wizard
