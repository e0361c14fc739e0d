#include "session/deviation/prototype_comparison.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>
#include <vector>

#include "calib/capture.h"
#include "calib/surface/scan.h"
#include "calib/surface/scan_overlap.h"
#include "core/stopwatch.h"
#include "session/deviation/comparison_layer.h"
#include "wizard/capture/rig_recheck.h"
#include "wizard/measure/comparison.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

// Surfaces further in front of the CAD's box than this, or behind it, are not measured.
constexpr double k_around_m = 0.1;
// The start comes from the tracker: a centimetre at most, as a share of the mesh's diagonal.
constexpr double k_start_reach_m = 0.015;
// A marker's plate: the white margin as a share of the marker's side, the clay that its edge hides, and how
// far the clay is in front of the marker or behind it.
constexpr double k_paper = 0.15, k_plate_edge_m = 3e-3, k_plate_m = 10e-3;
// With inverse patterns: the standard deviations then say how large the errors are.
constexpr auto k_code = calib::PatternCode::gray;

std::vector<calib::CapturedDevice> devices(const std::vector<Imager>& imagers) {
  std::vector<calib::CapturedDevice> list;
  for (const Imager& imager : imagers)
    list.push_back({imager.name, imager.width, imager.height, imager.sees});
  return list;
}

// Cameras for infrared light see no patterns.
calib::CaptureSet without_infrared(calib::CaptureSet captures) {
  for (std::size_t i = captures.cameras.size(); i-- > 0;) {
    if (captures.cameras[i].sees == Spectrum::visible) continue;
    const auto at = static_cast<std::ptrdiff_t>(i);
    captures.cameras.erase(captures.cameras.begin() + at);
    for (calib::CapturedPose& pose : captures.poses)
      for (auto& of_projector : pose.images) of_projector.erase(of_projector.begin() + at);
  }
  return captures;
}

Eigen::AlignedBox3d box_of(const scene::Mesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p.cast<double>());
  return box;
}

// The distances from the cameras at which the CAD may be.
void limit_distances(const Rig& rig,
                     const Eigen::AlignedBox3d& box,
                     const Pose& world_from_prototype,
                     calib::RangeOptions* range) {
  double nearest = std::numeric_limits<double>::infinity(), farthest = 0;
  for (const Imager& camera : rig.cameras) {
    if (camera.sees != Spectrum::visible) continue;
    const Eigen::Vector3d p_eye =
        world_from_prototype.inverse() * camera.imager_from_world.inverse().translation;
    nearest = std::min(nearest, box.exteriorDistance(p_eye));
    for (int k = 0; k < 8; ++k)
      farthest =
          std::max(farthest, (box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k)) - p_eye).norm());
  }
  range->nearest_m = std::max(0.0, nearest - k_around_m);
  range->farthest_m = farthest + k_around_m;
}

// The scan without what lies where the markers are: their plates, and the edges around these.
scene::ScanSurface without_markers(const ScannedPrototype& scanned) {
  const std::vector<Eigen::Vector3f>& points = scanned.surface->positions;
  std::vector<bool> keep(points.size(), true);
  for (const SeenMarker& marker : scanned.markers) {
    const Pose marker_from_world = marker.world_from_marker.inverse();
    const double half_m = (0.5 + k_paper) * marker.size_m + k_plate_edge_m;
    const Eigen::AlignedBox3d plate(Eigen::Vector3d(-half_m, -half_m, -k_plate_m),
                                    Eigen::Vector3d(half_m, half_m, k_plate_m));
    for (std::size_t i = 0; i < keep.size(); ++i)
      if (plate.contains(marker_from_world * points[i].cast<double>())) keep[i] = false;
  }
  return scene::with_vertices_kept(*scanned.surface, keep);
}

Status check_rig(const Rig& rig) {
  const bool has_camera = std::ranges::count(rig.cameras, Spectrum::visible, &Imager::sees) > 0;
  if (has_camera && !rig.projectors.empty()) return {};
  return error(
      "expected a camera for visible light and a projector that reach the prototype, found {} cameras and {} "
      "projectors.",
      std::ranges::count(rig.cameras, Spectrum::visible, &Imager::sees), rig.projectors.size());
}

ReportStage stage_report(const ShouldContinue& should_continue) {
  if (!should_continue) return {};
  return [should_continue](const Stage&) { return should_continue(); };
}

// The registration of the whole scan.
Result<calib::Registration> registered(const wizard::ScanBesideCad& both,
                                       const Pose& world_from_tracked,
                                       const ComparisonInput& input) {
  if (input.held) return *input.held;
  const double diagonal = std::max(1e-3, box_of(both.mesh).diagonal().norm());
  return calib::refined_registration(
      both.mesh, both.index, both.scan, world_from_tracked,
      {.reach = std::min(0.12, k_start_reach_m / diagonal), .free_stddev_m = wizard::k_free_stddev_m});
}

}  // namespace

std::vector<SeenMarker> seen_markers(std::span<const Body> bodies, std::span<const Track> tracks) {
  std::vector<SeenMarker> seen;
  for (const Track& track : tracks) {
    const auto body = std::ranges::find(bodies, track.body, &Body::name);
    if (body == bodies.end() || track.tracking != TrackingState::measured) continue;
    for (const BodyMarker& marker : body->markers)
      seen.push_back({track.world_from_body * marker.body_from_marker, marker.size_m});
  }
  return seen;
}

int scan_images(const Rig& rig) {
  int images = 0;
  for (const Imager& projector : rig.projectors)
    if (const auto patterns = calib::Patterns::create(k_code, projector.width, projector.height))
      images += patterns->count();
  return images;
}

Result<ScannedPrototype> scanned_in_place(const Rig& rig,
                                          const scene::Mesh& cad,
                                          const Pose& world_from_tracked,
                                          const std::vector<SeenMarker>& markers,
                                          const wizard::WizardBackend& backend,
                                          const fs::path& folder,
                                          const ShouldContinue& should_continue) {
  LIMN_TRY_STATUS(check_rig(rig));
  LIMN_TRY(const calib::Board board, wizard::calibration_board(rig));
  LIMN_TRY_STATUS(wizard::capture_once(
      calib::plan_captures(folder, devices(rig.cameras), devices(rig.projectors), board, k_code), rig,
      backend));
  LIMN_TRY(const calib::CaptureSet captured, calib::load_captures(folder));
  calib::ScanOptions options;
  options.poses = {captured.poses.front().name};
  options.report_stage = stage_report(should_continue);
  limit_distances(rig, box_of(cad), world_from_tracked, &options.range);
  LIMN_TRY(calib::Scan scan, calib::scan_captures(without_infrared(captured), rig, options));
  return ScannedPrototype{std::make_shared<const scene::ScanSurface>(std::move(scan.mesh)),
                          world_from_tracked, markers, std::move(scan.warnings)};
}

Result<PrototypeComparison> compared_with_cad(const ScannedPrototype& scanned,
                                              const ComparisonInput& input,
                                              const ShouldContinue& should_continue) {
  const auto begun = std::chrono::steady_clock::now();
  const scene::MeshBvh index(*input.cad);
  const scene::ScanSurface scan = without_markers(scanned);
  const wizard::ScanBesideCad both{*input.cad, index, scan};
  PrototypeComparison out;
  out.scanned = scanned;
  LIMN_TRY(out.whole, registered(both, scanned.world_from_tracked, input));
  if (const Status same = calib::check_overlap(
          calib::overlap(both.mesh, both.index, both.scan, out.whole.world_from_prototype));
      !same)
    return error("{}", same.message());
  calib::Registration used = out.whole;
  if (input.fit_box && !input.held) {
    const auto fitted = wizard::fitted_in_box(both, *input.fit_box, used.world_from_prototype);
    if (!fitted) return error("fit: {}", fitted.message());
    used = *fitted;
  }
  LIMN_TRY(out.report, wizard::compared(both, used,
                                        {.tolerance_m = input.tolerance_m,
                                         .report_stage = stage_report(should_continue)}));
  out.report.cad = input.cad_name;
  out.report.scan = "scanned during the session";
  out.report.start = input.held ? "held" : "tracked pose";
  if (!input.held) out.report.fit_box = input.fit_box;
  std::vector<std::string> warnings = scanned.warnings;
  warnings.insert(warnings.end(), out.report.warnings.begin(), out.report.warnings.end());
  out.report.warnings = std::move(warnings);
  if (should_continue && !should_continue()) return error("the session was ended.");
  out.layer =
      std::make_shared<const scene::DeviationLayer>(comparison_layer(*input.cad, out.report, input.number));
  out.report.seconds = 1e-3 * milliseconds_since(begun);
  return out;
}

}  // namespace limn::session
