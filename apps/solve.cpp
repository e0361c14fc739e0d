#include "apps/solve.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <vector>

#include "calib/model_selection.h"
#include "calib/report/report.h"
#include "core/print.h"

namespace limn::apps {
namespace {

void print_lenses(const std::vector<calib::ModelTrial>& trials) {
  for (const calib::ModelTrial& trial : trials)
    print_out("{:<14} {:<20} {}{}\n", trial.device, trial.model,
              std::isfinite(trial.held_out_px) ? fmt::format("held-out {:.3f} px", trial.held_out_px)
                                               : "no solution",
              trial.chosen ? ", chosen" : "");
}

void print_report(const calib::Report& report) {
  const calib::Assessment& assessment = report.assessment;
  print_out("{:<14} {:>8} {:>9} {:>9}\n", "device", "RMS px", "outliers", "coverage");
  for (const calib::DeviceQuality& d : assessment.devices)
    print_out("{:<14} {:>8.3f} {:>4}/{:<4} {:>7.0f} %\n", d.name, d.rms_px, d.outliers, d.points,
              100 * d.coverage);
  const bool has_projectors = !report.observed.observations.projectors.empty();
  print_out("{:<14} {:>8} {:>9}\n", "held-out pose", "RMS px", has_projectors ? "cells" : "corners");
  for (const calib::HeldOutPose& pose : assessment.held_out.poses)
    print_out("{:<14} {:>8.3f} {:>9}\n", pose.pose, pose.rms_px, pose.cells);
  for (const calib::ScaleBarCheck& check : report.scale_bar_lengths) {
    if (!check.views.empty())
      print_out("length {}: expected {:.2f} mm, measured {:.2f} mm, standard deviation {:.2f} mm\n",
                check.known.text(), 1e3 * check.known.length_m, 1e3 * check.measured_m, 1e3 * check.stddev_m);
  }
  for (const calib::Fault& fault : assessment.faults) print_out("fault {}\n", calib::to_text(fault));
  for (const std::string& sentence : report.explanation.advice) print_out("advice: {}\n", sentence);
  print_out("held-out {:.3f} px RMS, worst {:.3f} px{}\n{}\n", assessment.held_out.rms_px,
            assessment.held_out.worst_px,
            has_projectors ? fmt::format("; decoded {:.0f} %", 100 * assessment.decoded_share) : "",
            report.explanation.verdict);
}

}  // namespace

Status run_solve(const wizard::SolveCommandOptions& options, bool is_json) {
  LIMN_TRY(const calib::Report report, wizard::solve_captures(options));
  if (is_json) {
    print_out("{}", calib::report_json(report));
  } else {
    print_lenses(report.lens_trials);
    print_report(report);
    print_out("rig and report in {}\n", options.out.string());
  }
  if (report.assessment.verdict == calib::Verdict::reject)
    return error(
        "{}: the calibration is rejected. Rig and report are written. Correct what report.html names, and "
        "capture again.",
        options.out.string());
  return {};
}

}  // namespace limn::apps
