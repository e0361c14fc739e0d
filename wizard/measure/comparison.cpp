#include "wizard/measure/comparison.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/time_now.h"

namespace limn::wizard {
namespace {

namespace fs = std::filesystem;

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

}  // namespace

Result<calib::Registration> fitted_in_box(const ScanBesideCad& both,
                                          const Eigen::AlignedBox3d& box,
                                          const Pose& world_from_prototype) {
  const scene::ScanSurface part = calib::part_in_box(both.scan, world_from_prototype, box.min(), box.max());
  // A local fit only moves what the whole one left over.
  constexpr double k_reach = 0.02;
  const double size = std::max(1e-9, box.diagonal().norm());
  auto refined = part.positions.empty()
                     ? Result<calib::Registration>(error("no point of the scan lies in the box."))
                     : calib::refined_registration(
                           both.mesh, both.index, part, world_from_prototype,
                           {.reach = k_reach, .cell = 1 / 240.0, .free_stddev_m = k_free_stddev_m});
  if (!refined)
    return error("box of {:.0f} mm: {} Give a larger box, in mm of the CAD's frame, that the scan covers.",
                 1e3 * size, refined.message());
  return refined;
}

Result<calib::DeviationReport> compared(const ScanBesideCad& both,
                                        const calib::Registration& registration,
                                        const ComparisonOptions& options) {
  calib::DeviationReport report;
  report.made_at = time_now();
  report.registration = registration;
  if (options.is_given && !report.registration.free_directions.empty())
    report.registration.covariance = limited(report.registration.covariance, radius_of(both.mesh));
  LIMN_TRY(report.deviation, calib::deviation(both.mesh, both.scan, report.registration,
                                              {.tolerance_m = options.tolerance_m,
                                               .reach_m = options.reach_m,
                                               .spacing_m = options.spacing_m,
                                               .report_stage = options.report_stage}));
  report.summary = calib::summary_of(report.deviation);
  report.extremes = calib::extremes(report.deviation);
  report.warnings = calib::deviation_warnings(report.deviation, report.summary, report.registration);
  return report;
}

Status write_deviation_files(const calib::DeviationReport& report, const fs::path& out) {
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

}  // namespace limn::wizard
