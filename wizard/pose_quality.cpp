#include "wizard/pose_quality.h"

#include <algorithm>

#include "calib/report/advice.h"

namespace limn::wizard {
namespace {

constexpr double k_settled = 0.05;  // share; the error has settled if it fell by less over two poses

// Whether another pose may cure the fault; a person has to cure the others.
bool wants_poses(const calib::Fault& fault) {
  return fault.name == calib::FaultName::few_poses || fault.name == calib::FaultName::little_tilt ||
         fault.name == calib::FaultName::low_coverage;
}

}  // namespace

double predicted_mm(const calib::Assessment& assessment) {
  return *std::max_element(assessment.predicted_error_mm.begin(), assessment.predicted_error_mm.end());
}

std::string more_helps(const std::vector<PoseJudged>& poses) {
  if (poses.empty() || !poses.back().assessment) return "too few poses to solve a rig";
  const calib::Assessment& last = *poses.back().assessment;
  for (const auto* faults : {&last.faults, &last.advice}) {
    for (const calib::Fault& fault : *faults)
      if (wants_poses(fault)) return calib::to_text(fault.name);
  }
  if (last.verdict != calib::Verdict::good) return "the rig is " + calib::to_text(last.verdict);
  const double mm = predicted_mm(last);
  if (mm <= calib::k_fine_mm) return "";
  if (!calib::rests_on_enough_poses(last, static_cast<int>(poses.size())))
    return "too few poses to judge the accuracy";
  const auto earlier = poses.size() < 3 ? nullptr : &poses[poses.size() - 3].assessment;
  if (earlier == nullptr || !*earlier) return "the predicted error may still fall";
  const bool has_settled = mm > (1 - k_settled) * predicted_mm(**earlier);
  return has_settled ? "" : "the predicted error is still falling";
}

}  // namespace limn::wizard
