#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::apps {

struct ReplayOptions {
  std::filesystem::path session;  ///< what `limn live --record` wrote
  std::filesystem::path out;      ///< images and tables of the replay; empty: none
  double speed = 0;               ///< times the session's own; 0: as fast as possible
  bool step = false;              ///< waits for a line on stdin before each image
  bool window = false;
  bool json = false;
};

/// `limn replay`: runs a recorded session again through the same functions, from its frames and edits, and
/// compares poses with its log, to the last digit, and projector images by their fingerprints. Error: what
/// differs, and from which image on; a damaged recording is replayed up to the damage.
Status run_replay(const ReplayOptions& options);

}  // namespace limn::apps
