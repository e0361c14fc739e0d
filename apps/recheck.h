#pragma once

#include <filesystem>
#include <functional>

#include "apps/calibrate.h"
#include "calib/captures.h"
#include "calib/judge/recheck.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::apps {

struct RecheckCommand {
  std::filesystem::path rig;
  std::filesystem::path captures = {};  ///< captures folder with the board in one pose (or a few)
  /// Instead: its first poses, 15 s of captures, are taken on the virtual rig into `out`.
  std::filesystem::path plan = {};
  bool prototype = false;  ///< with a plan: of the prototype that stands there, without a board
  /// Instead: the rig's own cameras and projectors (limn.devices/1) capture what stands before them, once.
  std::filesystem::path devices = {};
  std::filesystem::path still = {};  ///< an earlier recheck.json whose boards have not been touched since
  std::filesystem::path out;         ///< rig folder to write
  bool json = false;                 ///< print recheck.json instead of a table
};

struct Rechecked {
  calib::Recheck result;
  int pictures = 0;  ///< shown and photographed, all cameras at once
};

/// Captures of the board, or of the prototype alone where three devices share it, against a calibrated rig:
/// has a camera or a projector moved? Writes the rig folder,
/// with that device's pose re-solved, and recheck.json. Where no single move explains what is seen, only
/// recheck.json is written and that is an error.
Result<Rechecked> rechecked(const RecheckCommand& command);

/// One pose of whatever stands before the devices of `around`, into the captures' folder; the projectors'
/// latencies as the rig has them.
Status captured_once(const calib::Captures& captures, const Rig& rig, const Surroundings& around);

/// The prototype as it stands, captured once by devices that are open already (those of `around`, with the
/// names and in the order of the rig's; of it stage, written and use_latency are needed), against the rig.
/// The result's rig is the mended one; it, recheck.json and captures/ are in `folder`. Error, and no rig is
/// written: no single move explains what is seen, or `goes_on`, which is asked now and then, says false.
Result<Rechecked> rechecked_in_place(const Rig& rig,
                                     const Surroundings& around,
                                     const std::filesystem::path& folder,
                                     const std::function<bool()>& goes_on = {});

/// How many pictures that shows.
int recheck_pictures(const Rig& rig);

/// `limn recheck`: as rechecked(), and prints a table.
Status run_recheck(const RecheckCommand& command);

}  // namespace limn::apps
