#include "wizard/measure/deviation_files.h"

#include <chrono>
#include <utility>

#include "core/stopwatch.h"
#include "wizard/measure/comparison.h"

namespace limn::wizard {
namespace {

Status check_deviation_options(const DeviationFilesOptions& options) {
  if (!(options.tolerance_m > 0) || !(options.reach_m > options.tolerance_m))
    return usage_error("--tolerance {:g} --reach-mm {:g}: expected 0 < tolerance < reach, in mm.",
                       1e3 * options.tolerance_m, 1e3 * options.reach_m);
  if (options.fit_box && !options.align.is_aligned)
    return usage_error("--fit: expected it without --no-align, which trusts the given pose.");
  return {};
}

}  // namespace

Result<calib::DeviationReport> write_deviation(const DeviationFilesOptions& options) {
  const auto begun = std::chrono::steady_clock::now();
  LIMN_TRY_STATUS(check_deviation_options(options));
  AlignOptions align = options.align;
  align.free_stddev_m = k_free_stddev_m;
  LIMN_TRY(ScanOnMesh found, aligned_scan(align));
  if (const Status same = calib::check_overlap(found.aligned.overlap); !same)
    return error("{}: {} Nothing was written.", found.file.string(), same.message());
  // Before a local fit, on all of the scan.
  measure_size(*found.mesh, *found.index, found.scan, &found.aligned);
  const ScanBesideCad both{*found.mesh, *found.index, found.scan};
  calib::Registration registration = found.aligned.registration;
  if (options.fit_box) {
    const auto fitted = fitted_in_box(both, *options.fit_box, registration.world_from_prototype);
    if (!fitted) return error("--fit: {}", fitted.message());
    registration = *fitted;
  }
  auto report = compared(both, registration,
                         {.tolerance_m = options.tolerance_m,
                          .reach_m = options.reach_m,
                          .spacing_m = options.spacing_m,
                          .is_given = !options.align.is_aligned,
                          .report_stage = align.report_stage});
  if (!report) return error("{}: {}", found.file.string(), report.message());
  report->cad = (align.mesh.empty() ? align.scene : align.mesh).string();
  report->scan = found.file.string();
  report->start = found.aligned.how;
  report->fit_box = options.fit_box;
  std::vector<std::string> warnings = found.aligned.warnings;
  for (std::string& warning : report->warnings) warnings.push_back(std::move(warning));
  report->warnings = std::move(warnings);
  report->seconds = 1e-3 * milliseconds_since(begun);
  LIMN_TRY_STATUS(reported(align.report_stage, {.name = "write"}));
  LIMN_TRY_STATUS(write_deviation_files(*report, align.out));
  return std::move(*report);
}

}  // namespace limn::wizard
