#pragma once

#include <chrono>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/rig.h"
#include "core/track.h"
#include "remote/api/pending_edits.h"
#include "remote/api/state.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "scene/show_state.h"

namespace limn::remote {

/// What the session reports to the remote at one moment.
struct SessionUpdate {
  SessionState state;
  std::vector<cv::Mat> projector_images;  ///< As they are shown, 8-bit BGR; they are not changed any more.
  std::vector<scene::Look> looks;
  std::shared_ptr<const scene::Scene> scene;
  std::shared_ptr<const Rig> rig;
  int scenes = 0;  ///< The number of scenes and rigs so far.
  /// The prototype and the parts as they are lit.
  scene::PosedScene posed = {};
  /// What cameras measured of the markers of viewers since the last update.
  std::vector<Track> viewer_tracks = {};
  Stamp at = {};                                       ///< The session's clock …
  std::chrono::steady_clock::time_point made_at = {};  ///< … at this moment.
  std::vector<EditResult> edit_results = {};           ///< Finished edits; `state` shows their effect.
};

}  // namespace limn::remote
