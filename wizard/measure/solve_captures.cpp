#include "wizard/measure/solve_captures.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>

#include "calib/capture_set.h"
#include "calib/judge/assess.h"
#include "calib/judge/board_check.h"
#include "calib/judge/capture_faults.h"
#include "calib/judge/image_check.h"
#include "calib/model_selection.h"
#include "calib/observations.h"
#include "calib/report/failed_report.h"
#include "calib/report/report.h"
#include "calib/response/measure_response.h"
#include "calib/response/vignetting.h"
#include "calib/solve.h"
#include "calib/tie_points.h"
#include "core/file.h"
#include "core/lens.h"
#include "core/log.h"
#include "core/rig.h"
#include "core/time_now.h"
#include "wizard/measure/scale_bars.h"
#include "wizard/measure/solve_cameras.h"

namespace limn::wizard {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begun) {
  return std::chrono::duration<double>(Clock::now() - begun).count();
}

// A projector's rows are part of what a solve finds.
Status check_axes(const calib::CaptureSet& captures) {
  for (size_t i = 0; i < captures.patterns.size(); ++i) {
    if (captures.patterns[i].options.axes == calib::CodeAxes::both) continue;
    return error(
        "{}: the images show the columns of {} only. Without its rows neither its height nor its vertical "
        "focal length is determined: capture the rows, too. (With a calibrated rig limn scan needs columns "
        "alone.)",
        captures.folder.string(), captures.projectors[i].name);
  }
  return {};
}

Status check_models(const SolveCommandOptions& options) {
  for (const std::string& name : {options.camera_model, options.projector_model}) {
    if (name == calib::k_auto_lens) continue;
    if (const auto model = LensModel::parse(name); !model) return usage_error("{}", model.message());
  }
  return {};
}

// Adds the corners of markers that several cameras see as tie points. Returns the markers' names.
Result<std::vector<std::string>> add_markers(const calib::CaptureSet& captures,
                                             std::vector<std::string> families,
                                             const std::vector<calib::ScaleBar>& lengths,
                                             calib::Observations* observations) {
  if (captures.cameras.size() < 2) return std::vector<std::string>();
  for (std::string& family : families_of(lengths)) families.push_back(std::move(family));
  std::sort(families.begin(), families.end());
  families.erase(std::unique(families.begin(), families.end()), families.end());
  LIMN_TRY(const auto marks, marks_of(captures, families));
  const std::vector<std::string> names = calib::add_marker_points(marks, observations);
  if (!names.empty()) log_info("markers that several cameras see: {}", fmt::join(names, ", "));
  return names;
}

// Measures the known lengths with the solved rig as if the print's size were known exactly, and solves again
// with what they show of it. Leaves the solution as it is where they contradict the board by more than prints
// are wrong.
Status use_lengths(const calib::CaptureSet& captures,
                   const calib::Observations& observations,
                   const std::vector<calib::ScaleBar>& lengths,
                   const std::vector<calib::DetectedMark>& marks,
                   const SolveCommandOptions& options,
                   calib::SolveOptions* solving,
                   calib::ModelSelection* choice) {
  const calib::Board& board = captures.board;
  if (marks.empty() || board.is_exact) return {};
  double assumed = 0;
  calib::Solution fixed = choice->solution;
  if (fixed.print.size() > 0) {
    constexpr double k_known = 1e-7;
    assumed = calib::print_growth(board, fixed.print).mean();
    calib::SolveOptions of_known_size = *solving;
    of_known_size.known_growth = {assumed, k_known};
    LIMN_TRY(fixed, calib::solve_from(observations, of_known_size, fixed));
  }
  LIMN_TRY(const auto checks, calib::measure_scale_bars(captures, fixed, marks, lengths));
  const auto found = calib::growth_by_lengths(checks, assumed);
  if (!found || !calib::may_be_growth(calib::expected_growth(board, solving->board_measured), *found))
    return {};
  solving->known_growth = found;
  solving->square_pixels = !options.pixels_not_square;
  solving->lens_models.clear();
  LIMN_TRY(*choice, calib::solve_selecting_models(observations, *solving));
  *solving = choice->options;
  return {};
}

// Measures the known lengths. A wrong length is a fault, and a rig with a fault of scale is never "good".
Status check_lengths(const calib::CaptureSet& captures,
                     const std::vector<calib::ScaleBar>& lengths,
                     const std::vector<calib::DetectedMark>& marks,
                     const calib::SolveOptions& solving,
                     calib::Report* report) {
  if (lengths.empty()) return {};
  const double widened = std::max(1.0, report->assessment.normalised_residuals.held_out.stddev);
  LIMN_TRY(report->scale_bar_lengths,
           calib::measure_scale_bars(captures, report->solution, marks, lengths, widened));
  for (const calib::ScaleBarCheck& check : report->scale_bar_lengths) {
    if (const auto fault = calib::scale_fault(check, captures.board, solving.board_measured,
                                              solving.known_growth.has_value()))
      calib::add_faults({*fault}, &report->assessment);
  }
  if (!solving.known_growth) return {};
  if (const auto note = calib::growth_note(*solving.known_growth, captures.board))
    calib::add_faults({*note}, &report->assessment);
  return {};
}

// What the rig's scale rests on, as docs/formats.md names it; a second board is a known length.
std::string scale_rests_on(const std::vector<calib::ScaleBarCheck>& checks, bool is_board_measured) {
  const auto is_any_seen = [&](bool is_marker) {
    return std::ranges::any_of(checks, [&](const calib::ScaleBarCheck& check) {
      return !check.views.empty() && (check.known.is_side() && !check.known.board) == is_marker;
    });
  };
  if (is_board_measured) return "board_measured";
  if (is_any_seen(false)) return "known_length";
  return is_any_seen(true) ? "markers" : "board";
}

// The error of a failed solve with the faults that explain it, which are also written to report.json.
Error explained(const Error& failure,
                const std::vector<calib::Fault>& faults,
                const SolveCommandOptions& options) {
  if (faults.empty()) return failure;
  if (const auto written = calib::write_failed_report(failure.message, faults, options.out); !written)
    log_warning("{}", written.message());
  return error("{}\n{}", failure.message, calib::to_text(calib::merged(faults)));
}

// Adds the faults that show when the rig is compared with the one that it replaces.
void compare_with_earlier(const SolveCommandOptions& options,
                          const calib::Solution& solution,
                          calib::Assessment* assessment) {
  if (!std::filesystem::exists(options.out / "rig.json")) return;
  const auto earlier = load_rig(options.out);
  if (earlier) calib::add_faults(calib::faults_against(*earlier, solution.rig), assessment);
}

// Measures the vignetting from the illuminated boards; only with cameras whose encoding is known.
Status measure_vignetting(const calib::CaptureSet& captures,
                          const calib::Report& report,
                          RigResponses* responses) {
  if (responses->cameras.empty()) return {};
  LIMN_TRY(const auto light,
           calib::paper_light(captures, report.observed.observations, report.solution, responses->cameras));
  calib::add_vignetting(light, captures.cameras, captures.projectors, responses);
  return {};
}

// Corners and matches of all captures. The steps of the stage are series of images; several threads read
// them.
Result<calib::Observed> observe_in_steps(const calib::CaptureSet& captures, const ReportStage& report) {
  Stage stage{.name = "decode", .total = static_cast<int>(captures.poses.size() * captures.cameras.size())};
  LIMN_TRY_STATUS(reported(report, stage));
  if (!report) return calib::observe(captures);
  std::mutex mutex;
  bool is_stopped = false;
  auto observed = calib::observe(captures, {}, [&] {
    const std::lock_guard lock(mutex);
    is_stopped = is_stopped || !report(stage);
    stage.done = std::min(stage.done + 1, stage.total);
    return !is_stopped;
  });
  if (is_stopped) return reported([](const Stage&) { return false; }, stage).error();
  return observed;
}

}  // namespace

Result<std::optional<calib::BoardMeasured>> measured_board(const calib::CaptureSet& captures,
                                                           const std::string& text) {
  std::optional<calib::BoardMeasured> measured = captures.board_measured;
  if (!text.empty()) {
    const auto parsed = calib::parse_board_measured(text);
    if (!parsed) return usage_error("{}", parsed.message());
    measured = *parsed;
  }
  if (measured) LIMN_TRY_STATUS(calib::check_measured(captures.board, *measured));
  return measured;
}

Result<calib::Report> solve_captures(const SolveCommandOptions& options) {
  const auto begun = Clock::now();
  LIMN_TRY_STATUS(check_models(options));
  if (options.cameras_only) return solve_cameras(options);
  LIMN_TRY(const calib::CaptureSet captures,
           captures_of(options.captures, options.skip_poses, options.foreign));
  LIMN_TRY_STATUS(check_axes(captures));
  LIMN_TRY_STATUS(calib::check_spectra(captures));
  LIMN_TRY(const auto measured, measured_board(captures, options.board_measured));
  LIMN_TRY(const auto lengths, scale_bar_lengths(captures, options.scale_bar_lengths));
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "images"}));
  LIMN_TRY_STATUS(calib::check_images(captures));
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "response"}));
  LIMN_TRY(calib::MeasuredResponse response, calib::measure_response(captures));
  for (const std::string& warning : response.warnings) log_warning("response: {}", warning);
  const double response_seconds = seconds_since(begun);
  LIMN_TRY(calib::Observed observed, observe_in_steps(captures, options.report_stage));
  LIMN_TRY_STATUS(calib::check_board(captures, observed.observations));
  LIMN_TRY(const auto tie_markers, add_markers(captures, options.families, lengths, &observed.observations));
  const double board_seconds = observed.seconds_board, decode_seconds = observed.seconds_decode;
  calib::SolveOptions solving;
  solving.camera_model = options.camera_model;
  solving.projector_model = options.projector_model;
  solving.board_measured = measured;
  solving.square_pixels = solving.board_measured && !options.pixels_not_square;
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "solve"}));
  const auto solving_begun = Clock::now();
  auto choice = calib::solve_selecting_models(observed.observations, solving);
  if (!choice) return explained(choice.error(), calib::unsolved_faults(observed), options);
  if (!options.pixels_not_square) {
    LIMN_TRY(*choice, calib::solve_uneven_print(observed.observations, std::move(*choice)));
  }
  solving = choice->options;
  std::vector<calib::DetectedMark> marks;
  if (!lengths.empty()) {
    LIMN_TRY(marks, scale_bar_marks(captures, choice->solution.rig, lengths));
  }
  LIMN_TRY_STATUS(use_lengths(captures, observed.observations, lengths, marks, options, &solving, &*choice));
  calib::Solution* const solution = &choice->solution;
  const double solve_seconds = seconds_since(solving_begun);
  log_info("solved in {} iterations; measuring the held-out error", solution->iterations);
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "assess"}));
  const auto judging_begun = Clock::now();
  calib::Assessment assessment = calib::assess(observed, *solution, std::move(choice->held_out), solving);
  compare_with_earlier(options, *solution, &assessment);
  calib::Report report{std::move(observed),
                       std::move(*solution),
                       std::move(assessment),
                       {{"response", response_seconds},
                        {"board", board_seconds},
                        {"decode", decode_seconds},
                        {"solve", solve_seconds},
                        {"assess", seconds_since(judging_begun)},
                        {"total", seconds_since(begun)}},
                       std::move(choice->trials)};
  LIMN_TRY_STATUS(measure_vignetting(captures, report, &response.responses));
  LIMN_TRY_STATUS(check_lengths(captures, lengths, marks, solving, &report));
  report.scale_rests_on = scale_rests_on(report.scale_bar_lengths, measured.has_value());
  const bool is_scale_checked = captures.board.is_exact || report.scale_rests_on != "board";
  report.explanation = calib::explain(report.observed, report.solution, report.assessment, is_scale_checked);
  report.tie_markers = tie_markers;
  report.made_at = time_now();
  report.history = calib::read_history(options.out);
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "write"}));
  LIMN_TRY_STATUS(write_together(options.out, [&](const std::filesystem::path& into) -> Status {
    LIMN_TRY_STATUS(calib::write_rig_folder(report, solving, into));
    return response.responses.projectors.empty() ? Status()
                                                 : save_responses(response.responses, response.mixings, into);
  }));
  return report;
}

}  // namespace limn::wizard
