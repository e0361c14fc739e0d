#pragma once

#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"
#include "core/rig.h"

namespace limn::calib {

struct DeviceQuality;
struct CrossValidation;

/// What a fault does to the verdict.
enum class Severity {
  note,   ///< nothing: what remains is sound
  doubt,  ///< never good: the numbers may hide what it does
  reject  ///< never usable: the rig is not what its names say
};

/// Something wrong with a capture that a person can put right.
struct Fault {
  std::string name;      ///< stable, for programs: board_not_visible, little_tilt, …
  std::string evidence;  ///< with numbers
  std::string advice;
  Severity severity = Severity::doubt;
};

/// The faults that captures and their solution show: those of capture_faults (calib/judge/capture_faults.h),
/// of poses, coverage and single poses, and of what the solved lenses and the board cannot be:
/// - keystone_or_scaling: a projector's pixels are not square;
/// - wrong_camera_resolution: a camera's are not, or its image was cut;
/// - little_overlap: a projector reaches little of what cameras see;
/// - rotated_projection: the image stands on its head and no hanging projector explains it;
/// - bent_board, wrong_square_size: calib/judge/board_faults.h.
/// `devices` and `held_out` may be empty: what they tell is left out.
std::vector<Fault> faults(const Observed& observed,
                          const Solution& solution,
                          const std::vector<DeviceQuality>& devices,
                          const CrossValidation& held_out);

/// What a solution says against an earlier one of the same devices: projectors_swapped (each stands where
/// another one stood), wrong_square_size (every distance has grown or shrunk by the same factor),
/// wrong_camera_resolution (a camera sees another field). Nothing where devices have come, gone or moved.
std::vector<Fault> faults_against(const Rig& earlier, const Rig& now);

/// The heaviest severity among them; note when there are none.
Severity heaviest(const std::vector<Fault>& faults);

/// One line for each: "NAME: EVIDENCE; ADVICE."
std::string to_text(const std::vector<Fault>& faults);

}  // namespace limn::calib
