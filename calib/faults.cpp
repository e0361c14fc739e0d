#include "calib/faults.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/assess.h"
#include "core/log.h"

namespace limn::calib {
namespace {

constexpr double k_little_tilt_deg = 10;  // boards closer than this to one plane do not fix the focal length
constexpr double k_low_share = 0.5;       // of lit pixels decoded
constexpr double k_low_coverage = 0.25;
constexpr double k_odd_pose = 2.5;  // held-out RMS of a pose over the median of the others
constexpr int k_few_poses = 5;

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void note_board(const Observations& observations, const Solution& solution, std::vector<Fault>* faults) {
  for (int pose = 0; pose < static_cast<int>(observations.poses.size()); ++pose) {
    const bool seen = std::any_of(observations.corners.begin(), observations.corners.end(),
                                  [&](const CornerSeen& corner) { return corner.pose == pose; });
    if (!seen)
      faults->push_back(
          {"board_not_visible",
           fmt::format("no camera sees the board in {}", observations.poses[static_cast<size_t>(pose)]),
           "a scene capture is fine; otherwise light the board and keep it in the picture"});
    if (seen && !solution.world_from_board[static_cast<size_t>(pose)])
      faults->push_back({"board_not_placed",
                         fmt::format("too few corners, or all on a line, in {}; it was left out",
                                     observations.poses[static_cast<size_t>(pose)]),
                         "keep more of the board in the picture and lit"});
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
    faults->push_back({"few_poses", fmt::format("{} board poses of {}", poses, observations.poses.size()),
                       "capture at least 8, tilted to different sides, at the working distance"});
  if (largest < k_little_tilt_deg)
    faults->push_back({"little_tilt",
                       fmt::format("the boards' planes differ by at most {:.1f} degrees", largest),
                       "tilt the board by 20 to 45 degrees to different sides"});
}

void note_pictures(const Observed& observed,
                   const std::vector<DeviceQuality>& devices,
                   std::vector<Fault>* faults) {
  const Observations& observations = observed.observations;
  for (const DecodeShare& share : observed.decoded) {
    const double part = share.lit > 0 ? static_cast<double>(share.decoded) / share.lit : 0;
    if (part < k_low_share)
      faults->push_back(
          {"low_decode",
           fmt::format("{} of {} in {}: {:.0f} % of {} lit pixels decoded",
                       observations.cameras[static_cast<size_t>(share.camera)].name,
                       observations.projectors[static_cast<size_t>(share.projector)].name,
                       observations.poses[static_cast<size_t>(share.pose)], 100 * part, share.lit),
           "focus the projector, darken the room, raise the exposure without saturating"});
  }
  for (const DeviceQuality& device : devices) {
    if (device.coverage < k_low_coverage)
      faults->push_back(
          {"low_coverage",
           fmt::format("{}: observations in {:.0f} % of the picture", device.name, 100 * device.coverage),
           "bring the board to the corners of the picture, too"});
  }
}

void note_odd_poses(const HeldOut& score, std::vector<Fault>* faults) {
  for (const HeldOutPose& pose : score.poses) {
    std::vector<double> others;
    for (const HeldOutPose& other : score.poses) {
      if (other.pose != pose.pose) others.push_back(other.rms_px);
    }
    if (others.size() < 3 || pose.rms_px < k_odd_pose * median(others) || pose.rms_px < k_good_px) continue;
    faults->push_back(
        {"odd_pose",
         fmt::format("{}: held-out {:.2f} px, the others' median {:.2f} px", pose.pose, pose.rms_px,
                     median(others)),
         "the board or a device may have moved while it was captured; try --skip-poses " + pose.pose});
  }
}

}  // namespace

std::vector<Fault> faults(const Observed& observed,
                          const Solution& solution,
                          const std::vector<DeviceQuality>& devices,
                          const HeldOut& held_out) {
  std::vector<Fault> found;
  note_board(observed.observations, solution, &found);
  note_geometry(observed.observations, solution, &found);
  note_pictures(observed, devices, &found);
  note_odd_poses(held_out, &found);
  return found;
}

}  // namespace limn::calib
