#include "apps/scan.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "calib/capture_set.h"
#include "core/file.h"
#include "core/log.h"
#include "core/print.h"
#include "core/rig.h"
#include "tracker/marker_image.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/virtual_capture.h"
#include "wizard/measure/scan_files.h"

namespace limn::apps {
namespace {

calib::ScanOptions options_of(const ScanCommand& command) {
  calib::ScanOptions options;
  options.poses = command.poses;
  options.moved = command.moved;
  options.pieces = command.pieces;
  options.range.nearest_m = command.near_m;
  if (command.far_m > 0) options.range.farthest_m = command.far_m;
  options.range.smooth_px = command.smooth_px;
  options.voxel_m = command.voxel_mm * 1e-3;
  return options;
}

Status check_options(const ScanCommand& command) {
  if (command.captures.empty() == command.plan.empty())
    return usage_error(
        "expected a captures folder, or --plan PLAN.json to capture on its virtual rig, found {}.",
        command.captures.empty() ? "neither" : "both");
  if (command.near_m < 0 || command.far_m < 0 || (command.far_m > 0 && command.far_m <= command.near_m))
    return usage_error("--near {} --far {}: expected 0 <= near < far, in metres from the camera.",
                       command.near_m, command.far_m);
  if (!std::filesystem::exists(command.rig))
    return usage_error("--rig {}: expected a rig folder or rig.json, found nothing. Run limn solve first.",
                       command.rig.string());
  return {};
}

// The captures; --poses of foreign captures says which folders are poses.
Result<calib::CaptureSet> captures_to_scan(const ScanCommand& command,
                                           const std::filesystem::path& folder,
                                           calib::ScanOptions* options) {
  wizard::ForeignOptions foreign = command.foreign;
  if (!foreign.import_format) return wizard::captures_of(folder, {}, foreign);
  if (!command.poses.empty()) foreign.poses = fmt::format("{}", fmt::join(command.poses, ","));
  LIMN_TRY(calib::CaptureSet captures, wizard::captures_of(folder, {}, foreign, false));
  options->poses.clear();
  if (!foreign.board.empty()) return captures;
  for (const calib::CapturedPose& pose : captures.poses) options->poses.push_back(pose.name);
  return captures;
}

}  // namespace

Status run_scan(const ScanCommand& command) {
  LIMN_TRY_STATUS(check_options(command));
  LIMN_TRY(const Rig rig, load_rig(command.rig));
  std::filesystem::path folder = command.captures;
  if (!command.plan.empty()) {
    LIMN_TRY(const wizard::Plan plan, wizard::load_plan(command.plan));
    LIMN_TRY(sim::World world, sim::load_world(plan.world, tracker::marker_image));
    sim::VirtualRig virtual_rig(std::move(world));
    folder = command.out / "captures";
    LIMN_TRY_STATUS(
        wizard::capture_prototype(plan, {virtual_rig.world().world_from_prototype}, &virtual_rig, folder));
  }
  calib::ScanOptions options = options_of(command);
  LIMN_TRY(const calib::CaptureSet captures, captures_to_scan(command, folder, &options));
  LIMN_TRY(const calib::Scan scan, wizard::make_scan(captures, rig, options, command.out));
  for (const std::string& warning : scan.warnings) log_warning("scan: {}", warning);
  if (command.json) {
    LIMN_TRY(const std::string json, read_file(command.out / "scan.json"));
    print_out("{}", json);
    return {};
  }
  print_out("{} points, standard deviation {:.3f} mm (median); mesh of {} triangles; in {}\n",
            scan.points.positions.size(), wizard::stddev_mm(scan, 0.5), scan.mesh.triangles.size(),
            command.out.string());
  return {};
}

}  // namespace limn::apps
