#include "wizard/measure/deviation_files.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/stopwatch.h"
#include "core/time_now.h"

namespace limn::wizard {
namespace {

namespace fs = std::filesystem;

// How far the start may be off along directions that the shape does not determine. Picked points, markers and
// the search are better than this.
constexpr double k_free_stddev_m = 5e-3;

Status check_deviation_options(const DeviationFilesOptions& options) {
  if (!(options.tolerance_m > 0) || !(options.reach_m > options.tolerance_m))
    return usage_error("--tolerance {:g} --reach-mm {:g}: expected 0 < tolerance < reach, in mm.",
                       1e3 * options.tolerance_m, 1e3 * options.reach_m);
  if (options.fit_box && !options.align.is_aligned)
    return usage_error("--fit: expected it without --no-align, which trusts the given pose.");
  return {};
}

// limn align states a metre along directions that the shape does not determine. With it every ripple of the
// scan would be uncertain: a start is better. `radius_m` is that of the mesh.
Matrix6d limited(const Matrix6d& covariance, double radius_m) {
  Vector6d scale;
  scale << Eigen::Vector3d::Constant(radius_m), Eigen::Vector3d::Ones();
  const Matrix6d scaled = scale.asDiagonal() * covariance * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(scaled);
  const Matrix6d axes = scale.cwiseInverse().asDiagonal() * solver.eigenvectors();
  const Vector6d variances = solver.eigenvalues().cwiseMax(0).cwiseMin(k_free_stddev_m * k_free_stddev_m);
  return axes * variances.asDiagonal() * axes.transpose();
}

double radius_of(const scene::Mesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p);
  return std::max(1e-3, static_cast<double>(box.diagonal().norm()) / 2);
}

// Fits again on the part of the scan inside the box, from where the whole scan lies.
Status fit_in_box(const Eigen::AlignedBox3d& box, double free_stddev_m, ScanOnMesh* found) {
  const Pose& pose = found->aligned.registration.world_from_prototype;
  const scene::ScanSurface part = calib::part_in_box(found->scan, pose, box.min(), box.max());
  // A local fit only moves what the whole one left over.
  constexpr double k_reach = 0.02;
  const double size = std::max(1e-9, box.diagonal().norm());
  auto refined = part.positions.empty()
                     ? Result<calib::Registration>(error("no point of the scan lies in the box."))
                     : calib::refined_registration(
                           *found->mesh, *found->index, part, pose,
                           {.reach = k_reach, .cell = 1 / 240.0, .free_stddev_m = free_stddev_m});
  if (!refined)
    return error(
        "--fit: box of {:.0f} mm: {} Give a larger box, in mm of the CAD's frame, that the scan covers.",
        1e3 * size, refined.message());
  found->aligned.registration = *refined;
  return {};
}

Status write_files(const calib::DeviationReport& report, const fs::path& out) {
  const nlohmann::ordered_json poses = {
      {"world_from_prototype", to_json(report.registration.world_from_prototype)}};
  return write_together(out, [&](const fs::path& into) -> Status {
    LIMN_TRY_STATUS(write_file(into / "deviation.html", calib::deviation_html(report)));
    LIMN_TRY_STATUS(write_file(into / "deviation.json", calib::deviation_json(report)));
    LIMN_TRY_STATUS(write_file(into / "deviation.csv", calib::deviation_csv(report.deviation)));
    LIMN_TRY_STATUS(write_file(into / "deviation.ply", calib::deviation_ply(report.deviation)));
    return write_file(into / "poses.json", json_text(poses, 2) + "\n");
  });
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
  if (options.fit_box) LIMN_TRY_STATUS(fit_in_box(*options.fit_box, k_free_stddev_m, &found));
  found.index.reset();  // memory

  calib::DeviationReport report;
  report.cad = (align.mesh.empty() ? align.scene : align.mesh).string();
  report.scan = found.file.string();
  report.made_at = time_now();
  report.registration = found.aligned.registration;
  if (!options.align.is_aligned && !report.registration.free_directions.empty())
    report.registration.covariance = limited(report.registration.covariance, radius_of(*found.mesh));
  report.start = found.aligned.how;
  report.fit_box = options.fit_box;
  const auto compared = calib::deviation(*found.mesh, found.scan, report.registration,
                                         {.tolerance_m = options.tolerance_m,
                                          .reach_m = options.reach_m,
                                          .spacing_m = options.spacing_m,
                                          .report_stage = align.report_stage});
  if (!compared) return error("{}: {}", found.file.string(), compared.message());
  report.deviation = *compared;
  report.summary = calib::summary_of(report.deviation);
  report.extremes = calib::extremes(report.deviation);
  report.warnings = found.aligned.warnings;
  for (std::string& warning :
       calib::deviation_warnings(report.deviation, report.summary, report.registration))
    report.warnings.push_back(std::move(warning));
  report.seconds = 1e-3 * milliseconds_since(begun);
  LIMN_TRY_STATUS(reported(align.report_stage, {.name = "write"}));
  LIMN_TRY_STATUS(write_files(report, align.out));
  return report;
}

}  // namespace limn::wizard
