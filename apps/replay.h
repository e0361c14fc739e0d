#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::apps {

struct ReplayOptions {
  std::filesystem::path session;  ///< Folder that `limn live --record` wrote.
  std::filesystem::path out;      ///< Folder for images and tables of the replay; empty: none.
  double speed = 0;               ///< Relative to the session's own speed; 0: as fast as possible.
  bool step = false;              ///< Waits for a line on stdin before each image.
  bool window = false;
  bool json = false;
};

/// `limn replay`: runs a recorded session again through the same functions, from its frames and edits.
/// Compares the poses with the recorded ones to the last digit, and the projector images by their
/// fingerprints. Error: what differs, and from which image on. A damaged recording is replayed up to the
/// damage.
Status run_replay(const ReplayOptions& options);

}  // namespace limn::apps
