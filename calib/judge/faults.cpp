#include "calib/judge/faults.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <tuple>
#include <utility>

#include "calib/judge/assess.h"
#include "calib/judge/board_faults.h"
#include "calib/judge/capture_faults.h"
#include "core/log.h"
#include "core/median.h"

namespace limn::calib {
namespace {

// Boards closer than this to one plane do not determine the focal length.
constexpr double k_little_tilt_deg = 10;
constexpr double k_low_share = 0.5;  // share of illuminated pixels decoded
constexpr double k_low_coverage = 0.25;
constexpr int k_few_poses = 5;
constexpr const char* k_skip_poses = "--skip-poses ";  // advice that ends with this option lists poses
// A smaller share of the boards illuminated, by a smaller share of the panel: most light lands where nothing
// was measured.
constexpr double k_overlap = 0.5, k_panel_used = 0.35;
// Deviation of fy / fx from 1: lenses and panels are square to 0.002.
constexpr double k_aspect = 0.01;
constexpr double k_camera_centre = 0.12;  // share of the width; cheap cameras are centred to 0.05
constexpr double k_turned_deg = 135;      // from here on an image is upside down rather than on its side
constexpr double k_shifted = 0.15;        // in image heights; less is a lens without shift
// Limits against an earlier calibration. Swapped projectors are far apart; a change of scale shows only if
// directions and lenses stayed the same.
constexpr double k_same_place = 0.05;      // share of the distance
constexpr double k_same_axes = 0.1;        // rad
constexpr double k_same_direction = 0.01;  // rad, and share of the focal lengths: between two calibrations
constexpr double k_scale = 0.005;
constexpr double k_zoom = 0.03;  // share of the field of view; refocusing changes it by 0.02

void note_board(const Observations& observations, const Solution& solution, std::vector<Fault>* faults) {
  for (int pose = 0; pose < static_cast<int>(observations.poses.size()); ++pose) {
    const std::string& name = observations.poses[static_cast<size_t>(pose)];
    const bool seen = std::any_of(observations.corners.begin(), observations.corners.end(),
                                  [&](const CornerObservation& corner) { return corner.pose == pose; });
    const bool is_scene = std::any_of(observations.points.begin(), observations.points.end(),
                                      [&](const TiePoint& point) { return point.pose == pose; });
    if (!seen && !is_scene)
      faults->push_back({FaultName::board_not_visible,
                         fmt::format("no camera sees the board in {}", name),
                         "a scene capture is fine; otherwise light the board and keep it in view",
                         Severity::note,
                         {name}});
    if (seen && !solution.world_from_board[static_cast<size_t>(pose)])
      faults->push_back({FaultName::board_not_placed,
                         fmt::format("too few corners, or all on a line, in {}; the pose is not used", name),
                         "keep more of the board in view and lit",
                         Severity::note,
                         {name}});
  }
}

void note_geometry(const Observations& observations, const Solution& solution, std::vector<Fault>* faults) {
  double largest = 0;
  int poses = 0;
  for (const auto& a : solution.world_from_board) {
    if (!a) continue;
    ++poses;
    for (const auto& b : solution.world_from_board) {
      if (!b) continue;
      const double cosine =
          (a->rotation * Eigen::Vector3d::UnitZ()).dot(b->rotation * Eigen::Vector3d::UnitZ());
      largest = std::max(largest, std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi);
    }
  }
  if (poses < k_few_poses)
    faults->push_back({FaultName::few_poses,
                       fmt::format("{} of {} poses show the board", poses, observations.poses.size()),
                       "capture at least 8, tilted to different sides, at the working distance"});
  if (largest < k_little_tilt_deg)
    faults->push_back({FaultName::little_tilt,
                       fmt::format("the boards' planes differ by at most {:.1f} degrees", largest),
                       "tilt the board by 20 to 45 degrees to different sides"});
}

void note_images(const Observed& observed,
                 const std::vector<DeviceQuality>& devices,
                 std::vector<Fault>* faults) {
  const Observations& observations = observed.observations;
  for (const DecodeShare& share : observed.decoded) {
    const double part = share.lit > 0 ? static_cast<double>(share.decoded) / share.lit : 0;
    if (part < k_low_share)
      faults->push_back(
          {FaultName::low_decode,
           fmt::format("{} of {} in {}: {:.0f} % of {} illuminated pixels decoded",
                       observations.cameras[static_cast<size_t>(share.camera)].name,
                       observations.projectors[static_cast<size_t>(share.projector)].name,
                       observations.poses[static_cast<size_t>(share.pose)], 100 * part, share.lit),
           "focus the projector, darken the room, raise the exposure without saturating",
           Severity::doubt,
           {observations.poses[static_cast<size_t>(share.pose)]}});
  }
  for (const DeviceQuality& device : devices) {
    if (device.coverage < k_low_coverage)
      faults->push_back(
          {FaultName::low_coverage,
           fmt::format("{}: observations in {:.0f} % of the image", device.name, 100 * device.coverage),
           "add poses with the board in the corners of the image", Severity::note});
  }
}

// The share of the board that a projector illuminates: its matches divided by those of as many whole boards
// as the cameras see.
double lit_share(const Observations& observations, int projector) {
  std::set<std::pair<int, int>> seen;
  for (const CornerObservation& corner : observations.corners) seen.emplace(corner.camera, corner.pose);
  std::map<std::tuple<int, int, int>, int> counts;
  int own = 0, whole = 0;
  for (const Match& match : observations.matches) {
    whole = std::max(whole, ++counts[{match.camera, match.pose, match.projector}]);
    own += match.projector == projector ? 1 : 0;
  }
  return static_cast<double>(own) / (static_cast<double>(seen.size()) * std::max(1, whole));
}

void note_overlap(const Observations& observations,
                  const std::vector<DeviceQuality>& devices,
                  std::vector<Fault>* faults) {
  for (size_t i = observations.cameras.size(); i < devices.size(); ++i) {
    const double lit = lit_share(observations, static_cast<int>(i - observations.cameras.size()));
    if (lit > k_overlap || devices[i].coverage > k_panel_used) continue;
    faults->push_back(
        {FaultName::little_overlap,
         fmt::format(
             "{} illuminates {:.0f} % of the boards' area that cameras see, with {:.0f} % of its pixels",
             devices[i].name, 100 * lit, 100 * devices[i].coverage),
         "turn projector and camera towards the same place, or hold the board where both reach it",
         // The held-out and predicted errors contain what it costs.
         Severity::note});
  }
}

void note_odd_poses(const CrossValidation& score, std::vector<Fault>* faults) {
  for (const OddPose& odd : odd_poses(score)) {
    const HeldOutPose& pose = score.poses[odd.index];
    if (pose.rms_px < k_good_px) continue;
    faults->push_back(
        {FaultName::odd_pose,
         fmt::format("{}: held-out error {:.2f} px, median of the other poses {:.2f} px", pose.pose,
                     pose.rms_px, odd.others_px),
         "the board or a device may have moved while it was captured; try --skip-poses " + pose.pose,
         Severity::doubt,
         {pose.pose}});
  }
}

double aspect(const Imager& imager) { return imager.lens.fy() / imager.lens.fx() - 1; }

void note_lenses(const Solution& solution, std::vector<Fault>* faults) {
  for (const Imager& projector : solution.rig.projectors) {
    if (std::abs(aspect(projector)) < k_aspect) continue;
    faults->push_back({FaultName::keystone_or_scaling,
                       fmt::format("{}: its pixels are {:.3f} times as wide as high", projector.name,
                                   1 + aspect(projector)),
                       "send the projector its native resolution; switch off keystone, zoom and aspect "
                       "corrections in the projector and the display's settings"});
  }
  for (const Imager& camera : solution.rig.cameras) {
    const double off = std::max(std::abs(camera.lens.cx() - (camera.width - 1) / 2.0),
                                std::abs(camera.lens.cy() - (camera.height - 1) / 2.0)) /
                       camera.width;
    if (std::abs(aspect(camera)) < k_aspect && off < k_camera_centre) continue;
    faults->push_back(
        {FaultName::wrong_camera_resolution,
         fmt::format("{}: its pixels are {:.3f} times as wide as high, its optical axis is {:.0f} % of the "
                     "width from the middle",
                     camera.name, 1 + aspect(camera), 100 * off),
         "use a resolution with the sensor's own shape, without stretching, digital zoom or cropping"});
  }
}

void note_turned(const Solution& solution, std::vector<Fault>* faults) {
  const Imager& camera = solution.rig.cameras[0];
  const Eigen::Vector3d d_down = camera.imager_from_world.rotation.inverse() * Eigen::Vector3d::UnitY();
  for (const Imager& projector : solution.rig.projectors) {
    const Eigen::Vector3d d = projector.imager_from_world.rotation * d_down;
    const double turned = std::abs(std::atan2(d.x(), d.y())) * 180 / std::numbers::pi;
    // Lenses shift the image up, away from the table; if the projector hangs, that is down in its own image.
    const double shift = (projector.lens.cy() - (projector.height - 1) / 2.0) / projector.height;
    if (turned < k_turned_deg || shift > k_shifted) continue;
    faults->push_back(
        {FaultName::rotated_projection,
         fmt::format("{}: its image is turned by {:.0f} degrees against {}; its lens shift ({:.2f} image "
                     "heights) is not that of a ceiling-mounted projector",
                     projector.name, turned, camera.name, shift),
         "switch off ceiling mounting (flip, rotation) in the projector's menu or the display's settings"});
  }
}

// Removes faults that follow from others.
void erase_implied(std::vector<Fault>* faults) {
  const auto has = [&](FaultName name) {
    return std::any_of(faults->begin(), faults->end(), [&](const Fault& f) { return f.name == name; });
  };
  // Where the board is stretched, or a projector's pixels are distorted to fit, the other lenses follow; a
  // camera whose pixels are not square makes the board look bent.
  const bool board = has(FaultName::wrong_square_size), panel = has(FaultName::keystone_or_scaling);
  const bool image = !board && !panel && has(FaultName::wrong_camera_resolution);
  std::erase_if(*faults, [&](const Fault& fault) {
    return (board && (fault.name == FaultName::wrong_camera_resolution ||
                      fault.name == FaultName::keystone_or_scaling)) ||
           (panel && fault.name == FaultName::wrong_camera_resolution) ||
           (image && fault.name == FaultName::board_not_flat);
  });
}

// The pose of a device relative to camera 0: its position and its axes.
struct Stand {
  std::string name;
  Eigen::Vector3d p_camera0;
  Eigen::Quaterniond rotation;
  double focal = 0;  // as a share of the image's width
};

std::vector<Stand> stands(const Rig& rig, const std::vector<Imager>& imagers) {
  std::vector<Stand> all;
  for (const Imager& imager : imagers) {
    const Pose camera0_from_imager = rig.cameras[0].imager_from_world * imager.imager_from_world.inverse();
    all.push_back({imager.name, camera0_from_imager.translation, camera0_from_imager.rotation,
                   imager.lens.fx() / imager.width});
  }
  return all;
}

// Whether device a stands where device b stood.
bool same_stand(const Stand& a, const Stand& b) {
  return (a.p_camera0 - b.p_camera0).norm() < k_same_place * b.p_camera0.norm() &&
         a.rotation.angularDistance(b.rotation) < k_same_axes;
}

void note_swapped(const std::vector<Stand>& before,
                  const std::vector<Stand>& now,
                  std::vector<Fault>* faults) {
  std::vector<std::string> swaps;
  for (const Stand& projector : now) {
    const auto there = std::find_if(before.begin(), before.end(),
                                    [&](const Stand& stand) { return same_stand(projector, stand); });
    if (there != before.end() && there->name != projector.name)
      swaps.push_back(fmt::format("{} is where {} was", projector.name, there->name));
  }
  if (swaps.empty()) return;
  faults->push_back(
      {FaultName::projectors_swapped, fmt::format("{}", fmt::join(swaps, ", ")),
       "connect each projector to its own display again (cables, display order); if the projectors "
       "have really changed places, run limn solve once more",
       Severity::reject});
}

void note_other_images(const Rig& earlier, const Rig& now, std::vector<Fault>* faults) {
  for (const Imager& camera : now.cameras) {
    const Imager* before = earlier.find(camera.name);
    if (!before) continue;
    const double zoom = camera.lens.fx() / camera.width / (before->lens.fx() / before->width);
    if (std::abs(zoom - 1) < k_zoom) continue;
    faults->push_back(
        {FaultName::wrong_camera_resolution,
         fmt::format(
             "{}: its image ({}x{}) has {:.3f} times the field of view of the earlier calibration ({}x{})",
             camera.name, camera.width, camera.height, 1 / zoom, before->width, before->height),
         "use the same camera mode as before, without digital zoom or cropping; if zoom or lens were changed "
         "on purpose, run limn solve once more"});
  }
}

// The factor by which all distances have changed while directions and lenses stayed; 1 when they did not.
double common_scale(const std::vector<Stand>& before, const std::vector<Stand>& now) {
  double low = 1e9, high = 0;
  for (size_t i = 0; i < now.size(); ++i) {
    const double was = before[i].p_camera0.norm(), is = now[i].p_camera0.norm();
    if (was < 1e-6 || is < 1e-6) return 1;
    const Eigen::Vector3d cross = (before[i].p_camera0 / was).cross(now[i].p_camera0 / is);
    if (before[i].name != now[i].name || cross.norm() > k_same_direction ||
        before[i].rotation.angularDistance(now[i].rotation) > k_same_direction ||
        std::abs(before[i].focal / now[i].focal - 1) > k_same_direction)
      return 1;
    low = std::min(low, is / was);
    high = std::max(high, is / was);
  }
  return now.empty() || high / low - 1 > k_scale / 2 ? 1 : (low + high) / 2;
}

}  // namespace

std::vector<Fault> faults(const Observed& observed,
                          const Solution& solution,
                          const std::vector<DeviceQuality>& devices,
                          const CrossValidation& held_out) {
  std::vector<Fault> found = capture_faults(observed);
  note_board(observed.observations, solution, &found);
  note_geometry(observed.observations, solution, &found);
  note_images(observed, devices, &found);
  note_overlap(observed.observations, devices, &found);
  note_odd_poses(held_out, &found);
  note_lenses(solution, &found);
  note_turned(solution, &found);
  for (const Fault& fault : board_faults(observed.observations, solution)) found.push_back(fault);
  erase_implied(&found);
  return found;
}

std::vector<Fault> faults_against(const Rig& earlier, const Rig& now) {
  std::vector<Fault> found;
  if (earlier.cameras.empty() || now.cameras.empty() || earlier.projectors.size() != now.projectors.size())
    return found;
  const std::vector<Stand> before = stands(earlier, earlier.projectors), after = stands(now, now.projectors);
  note_swapped(before, after, &found);
  note_other_images(earlier, now, &found);
  const double scale = common_scale(before, after);
  if (std::abs(scale - 1) > k_scale)
    found.push_back({FaultName::wrong_square_size,
                     fmt::format("every distance is {:.4f} times that of the earlier calibration, while all "
                                 "directions and lenses are the same",
                                 scale),
                     "measure the printed squares and give --board or the plan their size; if the earlier "
                     "board size was the wrong one, run limn solve once more",
                     Severity::reject});
  return found;
}

std::vector<Fault> merged(const std::vector<Fault>& faults) {
  std::vector<Fault> found;
  std::map<FaultName, int> further;
  for (const Fault& fault : faults) {
    const auto same = std::find_if(found.begin(), found.end(),
                                   [&](const Fault& earlier) { return earlier.name == fault.name; });
    if (same == found.end()) {
      found.push_back(fault);
      continue;
    }
    ++further[fault.name];
    same->severity = std::max(same->severity, fault.severity);
    same->noise_factor = std::max(same->noise_factor, fault.noise_factor);
    same->taken_out_px = std::max(same->taken_out_px, fault.taken_out_px);
    for (const std::string& pose : fault.poses) {
      if (std::find(same->poses.begin(), same->poses.end(), pose) != same->poses.end()) continue;
      same->poses.push_back(pose);
      if (same->advice.find(k_skip_poses) != std::string::npos) same->advice += "," + pose;
    }
  }
  for (Fault& fault : found) {
    if (further[fault.name] > 0)
      fault.evidence += fmt::format(" (and {} more of the same kind)", further[fault.name]);
  }
  return found;
}

Severity heaviest(const std::vector<Fault>& faults) {
  Severity worst = Severity::note;
  for (const Fault& fault : faults) worst = std::max(worst, fault.severity);
  return worst;
}

std::string to_text(const Fault& fault) {
  return fmt::format("{}{}{}: {}; {}.", to_text(fault.name), fault.poses.empty() ? "" : " in ",
                     fmt::join(fault.poses, ", "), fault.evidence, fault.advice);
}

std::string to_text(const std::vector<Fault>& faults) {
  std::string text;
  for (const Fault& fault : faults) text += fmt::format("{}{}", text.empty() ? "" : "\n", to_text(fault));
  return text;
}

}  // namespace limn::calib
