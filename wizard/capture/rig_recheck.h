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

namespace limn::apps {

struct Rechecked {
  calib::RigCheck result;
  int images = 0;  ///< shown and photographed, all cameras at once
};

/// What captures say of a rig, and how recheck.json says it.
struct CheckedRig {
  Rechecked rechecked;  ///< its rig is the mended one
  std::string json;
};

/// Checks a rig by the captures in `folder` and writes recheck.json into `out`. `still`: an earlier
/// recheck.json whose boards have not been touched since; empty: none. Error also when `should_continue`,
/// which is asked now and then, says false.
Result<CheckedRig> recheck_rig(const Rig& rig,
                               const std::filesystem::path& folder,
                               const std::filesystem::path& still,
                               const std::filesystem::path& out,
                               const std::function<bool()>& should_continue = {});

/// What a recheck found, as a sentence.
std::string recheck_sentence(const calib::RigCheck& result);

/// Error: no move of a single device explains what is seen.
Status check_explained(const calib::RigCheck& result);

/// The board that the rig was calibrated with, should that be in view.
Result<calib::Board> calibration_board(const Rig& rig);

/// One pose of whatever stands before the devices of `around`, into the captures' folder; the projectors'
/// latencies as the rig has them.
Status captured_once(const calib::CaptureSet& captures, const Rig& rig, const Surroundings& around);

/// The prototype as it stands, captured once by devices that are open already (those of `around`, with the
/// names and in the order of the rig's; of it stage, written and use_latency are needed), against the rig.
/// The result's rig is the mended one; it, recheck.json and captures/ are in `folder`. Error, and no rig is
/// written: no single move explains what is seen, or `should_continue`, which is asked now and then, says
/// false.
Result<Rechecked> rechecked_in_place(const Rig& rig,
                                     const Surroundings& around,
                                     const std::filesystem::path& folder,
                                     const std::function<bool()>& should_continue = {});

/// How many images that shows.
int recheck_images(const Rig& rig);

}  // namespace limn::apps
