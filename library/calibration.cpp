#include "limn/calibration.h"

#include <fmt/format.h>

#include <cmath>

#include "library/convert.h"
#include "wizard/measure/scan_alignment.h"
#include "wizard/measure/scan_files.h"
#include "wizard/measure/solve_captures.h"

namespace limn::LIMN_VERSIONED {
namespace {

Calibration calibration_of(const limn::calib::Report& report, const std::filesystem::path& out) {
  const limn::calib::Assessment& assessment = report.assessment;
  // From the files, so that what was measured of the devices' light is in it.
  Calibration calibration{.rig = Rig::load(out)};
  calibration.verdict = static_cast<Verdict>(assessment.verdict);
  calibration.explanation = report.explanation.verdict;
  calibration.advice = report.explanation.advice;
  for (const limn::calib::Fault& fault : assessment.faults)
    calibration.faults.push_back({limn::calib::to_text(fault.name), limn::calib::to_text(fault)});
  for (const limn::calib::DeviceQuality& device : assessment.devices)
    calibration.devices.push_back(
        {device.name, device.rms_px, device.points, device.outliers, device.coverage});
  for (const limn::calib::HeldOutPose& pose : assessment.held_out.poses)
    calibration.held_out.push_back({pose.pose, pose.rms_px});
  calibration.held_out_rms_px = assessment.held_out.rms_px;
  calibration.held_out_worst_px = assessment.held_out.worst_px;
  calibration.predicted_error_mm = assessment.predicted_error_mm;
  calibration.report_html = out / "report.html";
  return calibration;
}
static_assert(static_cast<int>(Verdict::usable) == static_cast<int>(limn::calib::Verdict::usable) &&
              static_cast<int>(Verdict::reject) == static_cast<int>(limn::calib::Verdict::reject));

limn::scene::LengthUnit to_room(Unit unit) {
  switch (unit) {
    case Unit::metre:
      return limn::scene::LengthUnit::metre;
    case Unit::centimetre:
      return limn::scene::LengthUnit::centimetre;
    case Unit::millimetre:
      return limn::scene::LengthUnit::millimetre;
    case Unit::inch:
      return limn::scene::LengthUnit::inch;
    case Unit::foot:
      return limn::scene::LengthUnit::foot;
  }
  throw Error("unit: expected one of the units of length, found another number.");
}

void check(const ScanOptions& options) {
  if (!(options.near_m >= 0) || !std::isfinite(options.near_m) || !(options.far_m >= 0) ||
      (options.far_m > 0 && options.far_m <= options.near_m))
    throw Error(fmt::format("scan: expected 0 <= near_m < far_m, in metres from the camera, found {} and {}.",
                            options.near_m, options.far_m));
  if (options.pieces < 0 || !(options.voxel_m >= 0) || !std::isfinite(options.voxel_m) ||
      options.smooth_px < 0)
    throw Error(
        fmt::format("scan: expected pieces, voxel_m and smooth_px of at least 0, found {}, {} and {}.",
                    options.pieces, options.voxel_m, options.smooth_px));
}

}  // namespace

Calibration solve(const std::filesystem::path& captures,
                  const std::filesystem::path& out,
                  const SolveOptions& options) {
  StageReporter reporter(options.progress);
  limn::wizard::SolveCommandOptions command{.captures = captures, .out = out};
  command.skip_poses = options.skip_poses;
  command.camera_model = options.camera_model;
  command.projector_model = options.projector_model;
  command.cameras_only = options.cameras_only;
  command.foreign.board = options.board;
  command.scale_bar_lengths = options.scale_bars;
  command.families = options.families;
  command.board_measured = options.board_measured;
  command.pixels_not_square = options.pixels_not_square;
  command.report_stage = reporter.function();
  return calibration_of(reporter.value_of(limn::wizard::solve_captures(command)), out);
}

struct Surface::Impl {
  limn::scene::ScanSurface surface;
};

Surface::Surface(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

namespace {

// Eigen's vectors of three floats lie one after the other.
static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float));
std::span<const float> floats_of(const std::vector<Eigen::Vector3f>& points) {
  return points.empty() ? std::span<const float>() : std::span(points.front().data(), 3 * points.size());
}

}  // namespace

std::span<const float> Surface::positions() const { return floats_of(impl_->surface.positions); }
std::span<const float> Surface::normals() const { return floats_of(impl_->surface.normals); }
std::span<const float> Surface::stddevs() const { return impl_->surface.stddevs; }

std::span<const std::uint32_t> Surface::triangles() const {
  const auto& triangles = impl_->surface.triangles;
  if (triangles.empty()) return {};
  return std::span(triangles.front().data(), 3 * triangles.size());
}

Scan scan(const std::filesystem::path& captures,
          const Rig& rig,
          const std::filesystem::path& out,
          const ScanOptions& options) {
  check(options);
  StageReporter reporter(options.progress);
  limn::calib::ScanOptions scanning;
  scanning.poses = options.poses;
  scanning.moved = options.moved;
  scanning.pieces = options.pieces;
  scanning.range.nearest_m = options.near_m;
  if (options.far_m > 0) scanning.range.farthest_m = options.far_m;
  scanning.range.smooth_px = options.smooth_px;
  scanning.voxel_m = options.voxel_m;
  scanning.report_stage = reporter.function();
  const limn::calib::CaptureSet set = value_of(limn::wizard::captures_of(captures, {}, {}));
  limn::calib::Scan made = reporter.value_of(limn::wizard::make_scan(set, to_room(rig), scanning, out));
  const double stddev_m = 1e-3 * limn::wizard::stddev_mm(made, 0.5);
  const auto surface_of = [](limn::scene::ScanSurface&& surface) {
    return Surface(std::make_shared<const Surface::Impl>(Surface::Impl{std::move(surface)}));
  };
  return {surface_of(std::move(made.points)), surface_of(std::move(made.mesh)), stddev_m,
          std::move(made.warnings)};
}

Alignment align(const std::filesystem::path& scan,
                const std::filesystem::path& mesh,
                const std::filesystem::path& out,
                const AlignOptions& options) {
  if (scan.empty() || mesh.empty())
    throw Error("align: expected the files of a scan and of a mesh, found none.");
  StageReporter reporter(options.progress);
  limn::wizard::AlignOptions command;
  command.scan = scan;
  command.scan_units = to_room(options.scan_unit);
  command.mesh = mesh;
  if (options.mesh_unit) command.units = to_room(*options.mesh_unit);
  command.start = options.start;
  command.points = options.points;
  command.body = options.body;
  command.rig = options.rig;
  command.frames = options.frames;
  command.least_mm = options.least_mm;
  command.out = out;
  command.report_stage = reporter.function();
  const limn::wizard::MeshAligned aligned = reporter.value_of(limn::wizard::align_scan(command));
  const limn::calib::Registration& registration = aligned.registration;
  return {.world_from_prototype = to_public(registration.world_from_prototype),
          .covariance = to_public(registration.covariance),
          .rms_m = registration.rms_m,
          .used_points = registration.used,
          .scan_share = aligned.overlap.scan_share,
          .mesh_share = aligned.overlap.mesh_share,
          .free_directions = registration.free_directions,
          .how = aligned.how,
          .warnings = aligned.warnings};
}

}  // namespace limn::LIMN_VERSIONED
