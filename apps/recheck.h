#pragma once

#include <filesystem>

#include "core/result.h"
#include "wizard/capture/rig_recheck.h"

namespace limn::apps {

struct RecheckCommand {
  std::filesystem::path rig;
  std::filesystem::path captures = {};  ///< Captures folder with the board in one pose (or a few).
  /// Instead of captures: the first poses of this plan, as many as take 15 s, are captured on the virtual rig
  /// into `out`.
  std::filesystem::path plan = {};
  bool prototype = false;  ///< With a plan: capture the prototype where it is, without a board.
  /// Instead of captures: the rig's own cameras and projectors (limn.devices/1) capture once what is in front
  /// of them.
  std::filesystem::path devices = {};
  std::filesystem::path still = {};  ///< An earlier recheck.json whose boards have not been touched since.
  std::filesystem::path out;         ///< Rig folder to write.
  bool json = false;                 ///< Prints recheck.json instead of a table.
};

/// Compares captures of the board, or of the prototype alone if it is covered by at least three devices
/// (cameras and projectors), with a calibrated rig: has a camera or a projector moved? Writes the rig folder
/// with the solved pose of that device, and recheck.json. Error when no single move explains the captures;
/// then only recheck.json is written.
Result<wizard::Rechecked> recheck(const RecheckCommand& command);

/// `limn recheck`: calls recheck() and prints a table.
Status run_recheck(const RecheckCommand& command);

}  // namespace limn::apps
