#include "calib/surface/scan.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/core.hpp>

#include "calib/board/board_finder.h"
#include "calib/surface/global_registration.h"
#include "calib/surface/registration.h"
#include "calib/surface/scan_overlap.h"
#include "core/log.h"
#include "core/names.h"
#include "scene/meshes/mesh_bvh.h"

namespace limn::calib {
namespace {

// A pixel's range that differs by more (and by 5 sigma) shows something else.
constexpr double k_changed_m = 1e-3;
constexpr double k_changed_share = 0.05;   // share of the pixels: more than edges and noise explain
constexpr double k_bad_epipolar_px = 0.7;  // RMS; a good rig leaves 0.27 px (docs/measurements.md)
constexpr double k_other_rig_share = 0.5;  // share of the decoded pixels whose rays do not meet

double seconds_since(std::chrono::steady_clock::time_point begun) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
}

// The rig's imagers that the captures name, in the captures' order.
Result<std::vector<const Imager*>> chosen(const std::vector<CapturedDevice>& devices,
                                          const std::vector<Imager>& imagers,
                                          const char* kind) {
  std::vector<const Imager*> found;
  for (const CapturedDevice& device : devices) {
    const Imager* at = find_named(imagers, device.name);
    if (!at)
      return error(
          "the captures' {} {}: expected it in the rig, found there: {}. Use the rig that took these "
          "captures.",
          kind, device.name, joined_names(imagers));
    if (at->width != device.width || at->height != device.height)
      return error(
          "{} {}: the captures' images are {}x{}, but the rig was calibrated at {}x{}. Capture at that size, "
          "or calibrate again.",
          kind, device.name, device.width, device.height, at->width, at->height);
    found.push_back(at);
  }
  return found;
}

Result<bool> shows_board(const CaptureSet& captures, const CapturedPose& pose) {
  for (size_t camera = 0; camera < captures.cameras.size(); ++camera) {
    const CapturedDevice& device = captures.cameras[camera];
    const auto& white = pose.images[0][camera][static_cast<size_t>(captures.patterns[0].white())];
    LIMN_TRY(const cv::Mat image, read_shot(white, device.width, device.height));
    if (!find_board(captures.board, image).empty()) return true;
  }
  return false;
}

Result<std::vector<const CapturedPose*>> scene_poses(const CaptureSet& captures, const ScanOptions& options) {
  std::vector<const CapturedPose*> poses;
  for (const std::string& name : options.poses) {
    const CapturedPose* at = find_named(captures.poses, name);
    if (!at) return error("--poses: there is no pose '{}' in {}.", name, captures.folder.string());
    poses.push_back(at);
  }
  if (!options.poses.empty()) return poses;
  for (const CapturedPose& pose : captures.poses) {
    LIMN_TRY(const bool board, shows_board(captures, pose));
    if (!board) poses.push_back(&pose);
  }
  if (poses.empty())
    return error(
        "{}: all {} poses show the board: there is nothing to scan. Put the prototype in place and "
        "capture a pose, or name poses with --poses.",
        captures.folder.string(), captures.poses.size());
  return poses;
}

void keep_pieces(int count, RangeView* view) {
  std::vector<double> areas;
  const cv::Mat piece = connected_components(*view, &areas);
  restrict_to((piece > 0) & (piece <= count), view);
}

// The surface that one camera measured in one pose with all projectors.
Result<RangeView> view_of(const CaptureSet& captures,
                          const CapturedPose& pose,
                          size_t camera,
                          const Imager& camera_imager,
                          const std::vector<const Imager*>& projectors,
                          const ScanOptions& options,
                          Scan* scan) {
  const auto begun = std::chrono::steady_clock::now();
  std::vector<Decoded> decoded;
  for (size_t p = 0; p < projectors.size(); ++p) {
    LIMN_TRY(Decoded one, decode(captures.patterns[p], pose.images[p][camera], camera_imager.width,
                                 camera_imager.height, options.decode));
    decoded.push_back(std::move(one));
  }
  scan->seconds_decode += seconds_since(begun);
  const auto decoded_at = std::chrono::steady_clock::now();
  std::vector<DecodedBy> seen;
  for (size_t p = 0; p < projectors.size(); ++p) seen.push_back({projectors[p], &decoded[p]});
  RangeView view = range_view(camera_imager, seen, options.range);
  if (options.pieces > 0)
    keep_pieces(options.pieces, &view);
  else if (options.moved)
    keep_pieces(1, &view);  // objects that stood still must not be registered
  scan->seconds_range += seconds_since(decoded_at);
  return view;
}

Status plausible(const ScanView& seen, std::vector<std::string>* warnings) {
  const RangeCounts& counts = seen.view.counts;
  const auto decoded = static_cast<double>(counts.decoded);
  if (counts.epipolar > k_other_rig_share * decoded)
    return error(
        "{} {}: camera and projector rays miss each other by {:.1f} pixels (median): this is not the rig "
        "that took the captures, or a device has been moved since. Calibrate again.",
        seen.pose, seen.camera, counts.epipolar_median_px);
  if (counts.epipolar_rms_px > k_bad_epipolar_px)
    warnings->push_back(fmt::format(
        "{} {}: camera and projector rays miss each other by {:.2f} pixels RMS; in a good rig it is "
        "0.25. Has a device been moved?",
        seen.pose, seen.camera, counts.epipolar_rms_px));
  if (counts.conflicts > 0.02 * counts.kept)
    warnings->push_back(fmt::format(
        "{} {}: the projectors contradict each other in {} pixels ({} agree or are seen by one projector "
        "only): has one of them been moved?",
        seen.pose, seen.camera, counts.conflicts, counts.kept));
  return {};
}

// Share of the pixels with a range in both views of one camera whose ranges differ.
double changed_share(const RangeView& a, const RangeView& b) {
  int both = 0, changed = 0;
  for (int y = 0; y < a.range.rows; ++y) {
    for (int x = 0; x < a.range.cols; ++x) {
      if (!a.has(x, y) || !b.has(x, y)) continue;
      const float sigma = std::hypot(a.stddev.at<float>(y, x), b.stddev.at<float>(y, x));
      ++both;
      changed += std::abs(a.range.at<float>(y, x) - b.range.at<float>(y, x)) >
                 static_cast<float>(k_changed_m) + 5 * sigma;
    }
  }
  return both > 0 ? static_cast<double>(changed) / both : 0;
}

Status standing_still(const std::vector<ScanView>& views) {
  for (const ScanView& view : views) {
    const ScanView& first =
        *std::find_if(views.begin(), views.end(), [&](const ScanView& v) { return v.camera == view.camera; });
    const double share = changed_share(first.view, view.view);
    if (share > k_changed_share)
      return error(
          "{}: {:.0f} % of {}'s pixels have another distance than in {}: the prototype was moved between "
          "these poses. Use --moved to register the poses to each other, or choose poses with --poses.",
          view.pose, 100 * share, view.camera, first.pose);
  }
  return {};
}

constexpr double k_same_m = 2e-3;  // distance of two poses' surfaces where they are the same
// Share of a pose's points on the first pose's surface: all except those that only one pose saw.
constexpr double k_laid_share = 0.7;
constexpr double k_least_share = 0.3;  // with less it is not certain that both are the same object

// Joins the views `from` to `to` to one surface.
scene::ScanSurface joint_surface(const std::vector<ScanView>& views, size_t from, size_t to) {
  scene::ScanSurface all;
  for (size_t i = from; i < to; ++i) {
    const scene::ScanSurface one = surface_of(views[i].view);
    const auto first = static_cast<std::uint32_t>(all.positions.size());
    all.positions.insert(all.positions.end(), one.positions.begin(), one.positions.end());
    all.normals.insert(all.normals.end(), one.normals.begin(), one.normals.end());
    all.stddevs.insert(all.stddevs.end(), one.stddevs.begin(), one.stddevs.end());
    for (const auto& [a, b, c] : one.triangles) all.triangles.push_back({a + first, b + first, c + first});
  }
  return all;
}

double share_laid(const scene::MeshBvh& index,
                  const scene::ScanSurface& surface,
                  const Registration& registration) {
  const std::vector<float> off = residuals(index, surface, registration, k_same_m);
  const auto on = std::count_if(off.begin(), off.end(), [](float r) { return !std::isnan(r); });
  return static_cast<double>(on) / static_cast<double>(std::max<size_t>(1, off.size()));
}

// Moves a view as if the prototype had stood still and the camera had moved.
void carry(const Pose& first_from_pose, ScanView* seen) {
  seen->first_from_pose = first_from_pose;
  seen->view.camera.imager_from_world = seen->view.camera.imager_from_world * first_from_pose.inverse();
  for (auto& n : cv::Mat_<cv::Vec3f>(seen->view.d_normal)) {
    const Eigen::Vector3f turned = first_from_pose.rotation.cast<float>() * Eigen::Vector3f(n[0], n[1], n[2]);
    n = {turned.x(), turned.y(), turned.z()};
  }
}

// Registers the surfaces of every later pose to the first pose's: starting from where they are, else
// globally.
Status lay_onto_first(Scan* scan) {
  const auto same_pose = [&](size_t i) {
    size_t end = i;
    while (end < scan->views.size() && scan->views[end].pose == scan->views[i].pose) ++end;
    return end;
  };
  const size_t first_end = same_pose(0);
  const scene::ScanSurface first = joint_surface(scan->views, 0, first_end);
  if (first.triangles.empty())
    return error("{}: no surface was measured in this pose, so the other poses cannot be registered to it.",
                 scan->views[0].pose);
  const scene::Mesh mesh = scene::mesh_of(first);
  const scene::MeshBvh index(mesh);
  for (size_t begin = first_end; begin < scan->views.size(); begin = same_pose(begin)) {
    const scene::ScanSurface surface = joint_surface(scan->views, begin, same_pose(begin));
    const std::string& name = scan->views[begin].pose;
    Registration best;
    double share = 0;
    if (const auto near = refined_registration(mesh, index, surface, Pose())) {
      best = *near;
      share = share_laid(index, surface, best);
    }
    if (share < k_laid_share) {
      const auto anywhere = global_registration(mesh, index, surface);
      if (anywhere && share_laid(index, surface, anywhere->registration) > share) {
        best = anywhere->registration;
        share = share_laid(index, surface, best);
      }
    }
    if (share < k_least_share)
      return error(
          "{}: only {:.0f} % of its surface can be registered to {}'s. Exclude what did not move with the "
          "prototype (--near, --far, --pieces), or the pose (--poses).",
          name, 100 * share, scan->views[0].pose);
    for (const std::string& free : best.free_directions)
      scan->warnings.push_back(
          fmt::format("{}: its shape does not determine a {} (world axes): views may be blurred "
                      "in that direction.",
                      name, free));
    const size_t end = same_pose(begin);
    for (size_t i = begin; i < end; ++i) carry(best.world_from_prototype.inverse(), &scan->views[i]);
  }
  return {};
}

Agreement over_all(const std::vector<ScanView>& views, double reach) {
  Agreement sum;
  for (size_t a = 0; a < views.size(); ++a)
    for (size_t b = 0; b < views.size(); ++b) {
      if (a == b) continue;
      const Agreement one = agreement(views[a].view, views[b].view, reach);
      if (one.count == 0) continue;
      const double share = static_cast<double>(one.count) / (sum.count + one.count);
      sum.rms_m = std::sqrt((1 - share) * sum.rms_m * sum.rms_m + share * one.rms_m * one.rms_m);
      sum.median_m += share * (one.median_m - sum.median_m);
      sum.median_sigmas += share * (one.median_sigmas - sum.median_sigmas);
      sum.count += one.count;
    }
  return sum;
}

Status nothing_seen(const CaptureSet& captures, const Scan& scan) {
  int decoded = 0;
  for (const ScanView& seen : scan.views) decoded += seen.view.counts.decoded;
  if (decoded == 0)
    return error(
        "{}: no camera pixel could be decoded in {} views: no projector's light was seen. Check the "
        "images: are they dark, or out of focus?",
        captures.folder.string(), scan.views.size());
  return error(
      "{}: {} camera pixels were decoded, but no surface is left of them (rays too parallel, too uncertain, "
      "too steep, or beyond the distance limits). Check --near and --far and the rig's report.",
      captures.folder.string(), decoded);
}

}  // namespace

Result<Scan> scan_captures(const CaptureSet& captures, const Rig& rig, const ScanOptions& options) {
  Scan scan;
  LIMN_TRY(const auto cameras, chosen(captures.cameras, rig.cameras, "camera"));
  LIMN_TRY(const auto projectors, chosen(captures.projectors, rig.projectors, "projector"));
  LIMN_TRY(const auto poses, scene_poses(captures, options));
  Progress progress("scan", static_cast<int>(poses.size() * cameras.size()));
  for (const CapturedPose* pose : poses) {
    for (size_t camera = 0; camera < cameras.size(); ++camera) {
      LIMN_TRY_STATUS(
          reported(options.report_stage, {.name = "scan",
                                          .done = static_cast<int>(scan.views.size()),
                                          .total = static_cast<int>(poses.size() * cameras.size())}));
      LIMN_TRY(RangeView view,
               view_of(captures, *pose, camera, *cameras[camera], projectors, options, &scan));
      scan.views.push_back({cameras[camera]->name, pose->name, std::move(view), Pose()});
      LIMN_TRY_STATUS(plausible(scan.views.back(), &scan.warnings));
      progress.step(static_cast<int>(scan.views.size()));
    }
  }
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "merge"}));
  LIMN_TRY_STATUS(options.moved ? lay_onto_first(&scan) : standing_still(scan.views));
  const auto begun = std::chrono::steady_clock::now();
  std::vector<RangeView> views;
  for (const ScanView& seen : scan.views) views.push_back(seen.view);
  const double spacing = point_spacing(views);
  if (spacing <= 0) return nothing_seen(captures, scan).error();
  scan.voxel_m = options.voxel_m > 0 ? options.voxel_m : 1.5 * spacing;
  scan.agreement = over_all(scan.views, 3 * scan.voxel_m);
  scan.points = fused_points(views);
  scan.mesh = fused_mesh(views, scan.voxel_m, options.least_area_m2);
  scan.seconds_merge = seconds_since(begun);
  return scan;
}

}  // namespace limn::calib
