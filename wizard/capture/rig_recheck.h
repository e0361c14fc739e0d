#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "calib/board/board.h"
#include "calib/capture_set.h"
#include "calib/judge/rig_check.h"
#include "core/result.h"
#include "core/rig.h"
#include "wizard/capture/backend.h"

namespace limn::wizard {

struct Rechecked {
  calib::RigCheck result;
  int images = 0;  ///< number of images shown; all cameras photograph each
};

/// The result of a rig check, and the text of recheck.json.
struct CheckedRig {
  Rechecked rechecked;  ///< its rig is the corrected one
  std::string json;
};

/// Checks a rig with the captures in `folder` and writes recheck.json into `out`. `still`: an earlier
/// recheck.json whose boards have not been touched since; empty: none. `should_continue` is called from time
/// to time; it is an error, too, if it returns false.
Result<CheckedRig> recheck_rig(const Rig& rig,
                               const std::filesystem::path& folder,
                               const std::filesystem::path& still,
                               const std::filesystem::path& out,
                               const std::function<bool()>& should_continue = {});

/// The result as a sentence.
std::string recheck_sentence(const calib::RigCheck& result);

/// Error: no move of a single device explains the observations.
Status check_explained(const calib::RigCheck& result);

/// The board that the rig was calibrated with; a default board if its provenance names none.
Result<calib::Board> calibration_board(const Rig& rig);

/// Captures one pose of whatever stands in front of the devices of `backend` into the captures' folder, with
/// the display latencies in the rig's provenance.
Status capture_once(const calib::CaptureSet& captures, const Rig& rig, const WizardBackend& backend);

/// Captures the prototype once as it stands and checks the rig with it. The devices of `backend` are already
/// open and have the rig's names and order; only capture, wait_for_files and use_latency are needed. The
/// result's rig is the corrected one; it, recheck.json and captures/ are written to `folder`. Error, and no
/// rig is written: no move of a single device explains the observations, or `should_continue`, which is
/// called from time to time, returns false.
Result<Rechecked> recheck_in_place(const Rig& rig,
                                   const WizardBackend& backend,
                                   const std::filesystem::path& folder,
                                   const std::function<bool()>& should_continue = {});

/// The number of images that recheck_in_place() shows.
int recheck_images(const Rig& rig);

}  // namespace limn::wizard
