#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "remote/api/pending_edits.h"
#include "remote/api/state.h"
#include "scene/scene.h"
#include "scene/show_state.h"

namespace limn::remote {

/// What the session reports to the remote at one moment.
struct SessionUpdate {
  SessionState state;
  std::vector<cv::Mat> projector_images;  ///< As they are shown, 8-bit BGR; they are not changed any more.
  std::vector<scene::Look> looks;
  std::shared_ptr<const scene::Scene> scene;
  std::vector<EditResult> edit_results;  ///< Finished edits; `state` shows their effect.
};

}  // namespace limn::remote
