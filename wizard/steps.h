#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/report/report.h"
#include "wizard/capture/exposure_check.h"
#include "wizard/capture/request.h"
#include "wizard/pose_quality.h"

namespace limn::wizard {

/// The wizard's steps, in their order.
enum class WizardStep { devices, outputs, exposure, latency, board, solve, result, scan, align, paint };
constexpr std::size_t k_wizard_steps = 10;
std::string to_text(WizardStep step);
enum class WizardState { waits, runs, done, fails };

/// Functions that the wizard calls while it works; all except `say` may be empty.
struct WizardListener {
  std::function<void(const std::string& line)> say;
  std::function<void(WizardStep step, WizardState state, const std::string& words)> step = nullptr;
  std::function<void(const std::vector<ExposureReading>&)> on_light = nullptr;
  std::function<void(int pose)> pose_begins = nullptr;         ///< the capture of a pose begins
  std::function<void(const calib::Report&)> solved = nullptr;  ///< the rig is saved
  std::function<void(int pose)> judging_begins = nullptr;      ///< decoding and judging of a pose begin
  /// A pose was judged; the observations are those of all poses so far.
  std::function<void(const PoseJudged&, const calib::Observations&, const std::vector<calib::Fault>&)>
      judged = nullptr;
  /// The board's size as a person has entered it so far (calib/board_print.h); empty: not entered.
  std::function<std::string()> board_measured = nullptr;
  std::atomic<WizardWish>* wish = nullptr;  ///< a person's request; set to none when it is followed
};

}  // namespace limn::wizard
