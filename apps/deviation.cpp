#include "apps/deviation.h"

#include <fmt/format.h>

#include "core/file.h"
#include "core/log.h"
#include "core/print.h"

namespace limn::apps {
namespace {

// Tells people who wait for a large CAD where the command is.
bool log_stage(const Stage& stage) {
  if (stage.done == 0) log_info("deviation: {}", stage.name);
  return true;
}

}  // namespace

Status run_deviation(const DeviationCommand& command) {
  wizard::DeviationFilesOptions options = command.files;
  options.tolerance_m = 1e-3 * command.tolerance_mm;
  options.reach_m = 1e-3 * command.reach_mm;
  options.spacing_m = 1e-3 * command.spacing_mm;
  options.align.is_aligned = !command.no_align;
  options.align.report_stage = log_stage;
  if (!command.fit_mm.empty()) {
    if (command.fit_mm.size() != 6)
      return usage_error("--fit: expected X,Y,Z,X,Y,Z of two corners in mm, found {} numbers.",
                         command.fit_mm.size());
    const Eigen::Map<const Eigen::Vector3d> a(command.fit_mm.data()), b(command.fit_mm.data() + 3);
    options.fit_box.emplace(1e-3 * a.cwiseMin(b));
    options.fit_box->extend(Eigen::Vector3d(1e-3 * a.cwiseMax(b)));
  }
  LIMN_TRY(const calib::DeviationReport report, wizard::write_deviation(options));
  for (const std::string& warning : report.warnings) log_warning("deviation: {}", warning);
  const std::filesystem::path& out = options.align.out;
  if (command.json) {
    LIMN_TRY(const std::string json, read_file(out / "deviation.json"));
    print_out("{}", json);
    return {};
  }
  print_out("{}\n", calib::deviation_text(report.summary, options.tolerance_m));
  for (const calib::DeviationExtreme& e : report.extremes)
    print_out(
        "{:+.2f} mm (standard deviation {:.2f}) at ({:.1f}, {:.1f}, {:.1f}) mm of the CAD, {:.0f} mm2\n",
        1e3 * e.distance_m, 1e3 * e.stddev_m, 1e3 * e.p_prototype.x(), 1e3 * e.p_prototype.y(),
        1e3 * e.p_prototype.z(), 1e6 * e.area_m2);
  print_out("see {}\n", (out / "deviation.html").string());
  return {};
}

}  // namespace limn::apps
