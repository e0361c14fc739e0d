#pragma once

#include <filesystem>

#include "core/result.h"
#include "wizard/capture/rig_recheck.h"

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

/// Captures of the board, or of the prototype alone where three devices share it, against a calibrated rig:
/// has a camera or a projector moved? Writes the rig folder,
/// with that device's pose re-solved, and recheck.json. Where no single move explains what is seen, only
/// recheck.json is written and that is an error.
Result<Rechecked> rechecked(const RecheckCommand& command);

/// `limn recheck`: as rechecked(), and prints a table.
Status run_recheck(const RecheckCommand& command);

}  // namespace limn::apps
