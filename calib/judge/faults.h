#pragma once

#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"
#include "core/enum_names.h"
#include "core/rig.h"

namespace limn::calib {

struct DeviceQuality;
struct CrossValidation;

/// The faults that captures can have. The function that finds a fault says what it means.
enum class FaultName {
  board_not_visible,
  board_not_placed,
  few_poses,
  little_tilt,
  low_decode,
  low_coverage,
  little_overlap,
  odd_pose,
  keystone_or_scaling,
  wrong_camera_resolution,
  rotated_projection,
  board_not_flat,
  wrong_square_size,
  projectors_swapped,
  wrong_display,
  mirrored_projection,
  exposure_drift,
  projector_gamma,
  moved_during_capture,
  defocus,
  ambient_light,
  saturated,
  repeated_pictures,
  scale_bar_not_seen,
  wrong_scale,
  uneven_print,
  shake,
  flicker
};
/// The names in reports, which programs read; they never change.
inline constexpr EnumNames<FaultName, 28> k_fault_names{{"board_not_visible",
                                                         "board_not_placed",
                                                         "few_poses",
                                                         "little_tilt",
                                                         "low_decode",
                                                         "low_coverage",
                                                         "little_overlap",
                                                         "odd_pose",
                                                         "keystone_or_scaling",
                                                         "wrong_camera_resolution",
                                                         "rotated_projection",
                                                         "board_not_flat",
                                                         "wrong_square_size",
                                                         "projectors_swapped",
                                                         "wrong_display",
                                                         "mirrored_projection",
                                                         "exposure_drift",
                                                         "projector_gamma",
                                                         "moved_during_capture",
                                                         "defocus",
                                                         "ambient_light",
                                                         "saturated",
                                                         "repeated_pictures",
                                                         "known_length_not_seen",
                                                         "wrong_scale",
                                                         "uneven_print",
                                                         "shake",
                                                         "flicker"}};
inline std::string to_text(FaultName name) { return k_fault_names.text(name); }

/// Effect of a fault on the verdict.
enum class Severity {
  note,   ///< no effect: what remains is sound
  doubt,  ///< at most usable: the numbers may hide the fault's effect
  reject  ///< always reject: the rig is not what its names say
};

/// Something wrong with a capture that a person can put right.
struct Fault {
  FaultName name;
  std::string evidence;  ///< with numbers
  std::string advice;
  Severity severity = Severity::doubt;
  std::vector<std::string> poses = {};  ///< names of the poses that show it; empty: it concerns all
  /// defocus: the scatter of edges as a multiple of that in focus; other faults: 1.
  double noise_factor = 1;
  /// shake, flicker: what would be left in the images of every pose, camera pixels; other faults: 0.
  double taken_out_px = 0;
};

/// The faults that captures and their solution show: those of capture_faults (calib/judge/capture_faults.h),
/// faults of poses and coverage, and implausible values of the solved lenses and the board:
/// - keystone_or_scaling: a projector's pixels are not square;
/// - wrong_camera_resolution: a camera's pixels are not square, or its image was cropped;
/// - little_overlap: a projector reaches little of what cameras see;
/// - odd_pose: a pose that odd_poses() (calib/cross_validation.h) names, with a held-out error that is not
/// good;
/// - rotated_projection: the image is upside down and no ceiling-mounted projector explains it;
/// - board_not_flat, wrong_square_size: calib/judge/board_faults.h.
/// `devices` and `held_out` may be empty; the faults that need them are then not checked.
std::vector<Fault> faults(const Observed& observed,
                          const Solution& solution,
                          const std::vector<DeviceQuality>& devices,
                          const CrossValidation& held_out);

/// Faults from comparing a solution with an earlier one of the same devices: projectors_swapped (each stands
/// where another one stood), wrong_square_size (every distance has grown or shrunk by the same factor),
/// wrong_camera_resolution (a camera has another field of view). Empty where devices were added, removed or
/// moved.
std::vector<Fault> faults_against(const Rig& earlier, const Rig& now);

/// One entry for each name, in the order of first appearance: all poses, the evidence of the first with the
/// number of further ones, the highest severity.
std::vector<Fault> merged(const std::vector<Fault>& faults);

/// The highest severity among them; note when there are none.
Severity heaviest(const std::vector<Fault>& faults);

/// "NAME in POSE, POSE: EVIDENCE; ADVICE."
std::string to_text(const Fault& fault);
/// One line for each.
std::string to_text(const std::vector<Fault>& faults);

}  // namespace limn::calib
