#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/imager.h"
#include "core/rig.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "scene/viewpoint.h"
#include "session/frame_input.h"

namespace limn::apps {

/// Whose eye `view` parts are drawn for in a frame.
struct SelectedViewpoint {
  Imager viewer = {};   ///< an imager at that eye
  std::string follows;  ///< the guest whose tablet it is, alone; empty: nobody's
  /// That eye's place while a guest has part in it, or it is on its way back.
  std::optional<Eigen::Vector3d> p_guest_eye_world = {};
};

/// Selects the eye: the scene's own viewer, one that all viewers share, or the tablet of the guest whom the
/// show state names. It passes from one to the next as between viewers (scene/viewpoint.h) and never jumps.
class ViewpointSelector {
 public:
  /// Borrows both.
  ViewpointSelector(const scene::Scene* scene, const Rig* rig);

  /// Stamps must not go back. A guest's place counts while it is new.
  const SelectedViewpoint& select(const scene::PosedScene& posed, const FrameInput& input);
  /// The newest one; its viewer's width is 0 before the first.
  const SelectedViewpoint& selected() const { return selected_; }

 private:
  const Imager* still_viewer() const;
  const Imager& stand_in() const;
  std::vector<scene::Viewpoint> guests_eyes(const FrameInput& input) const;
  Imager viewer_for(const scene::PosedScene& posed, std::vector<scene::Viewpoint> guests, Stamp at);
  void glide(std::vector<scene::Viewpoint>* guests, double seconds);

  const scene::Scene* scene_;
  const Rig* rig_;
  Eigen::Vector3d d_up_world_;
  SelectedViewpoint selected_;
  scene::SharedViewpoint shared_eye_;
  Stamp eye_at_;
  std::vector<scene::Viewpoint> gliding_;  // guests' eyes, as they are followed
  bool is_away_ = false;                   // a guest has part in the eye, or it is on its way back
};

}  // namespace limn::apps
