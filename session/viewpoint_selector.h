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

namespace limn::session {

/// The viewpoint that `view` parts are drawn for in a frame.
struct SelectedViewpoint {
  Imager viewer = {};   ///< an imager at the viewpoint
  std::string follows;  ///< the guest whose tablet alone is the viewpoint; empty: none
  /// The viewpoint (world frame, m) while it depends on a guest's tablet or moves back from it.
  std::optional<Eigen::Vector3d> p_guest_eye_world = {};
};

/// Selects the viewpoint: the scene's own viewer, the shared viewpoint of all viewers, or the tablet of the
/// guest whom the show state names. It passes from one to the next as between viewers (scene/viewpoint.h) and
/// never jumps.
class ViewpointSelector {
 public:
  /// Borrows both.
  ViewpointSelector(const scene::Scene* scene, const Rig* rig);

  /// Stamps must not go back. Tablet positions older than k_guest_place_lasts_s are ignored.
  const SelectedViewpoint& select(const scene::PosedScene& posed, const FrameInput& input);
  /// The last result of select(); its viewer's width is 0 before the first.
  const SelectedViewpoint& selected() const { return selected_; }

 private:
  const Imager* still_viewer() const;
  const Imager& substitute_viewer() const;
  std::vector<scene::Viewpoint> guests_eyes(const FrameInput& input) const;
  Imager viewer_for(const scene::PosedScene& posed, std::vector<scene::Viewpoint> guests, Stamp at);
  void move_smoothly(std::vector<scene::Viewpoint>* guests, double seconds);

  const scene::Scene* scene_;
  const Rig* rig_;
  Eigen::Vector3d d_up_world_;
  SelectedViewpoint selected_;
  scene::SharedViewpoint shared_eye_;
  Stamp eye_at_;
  std::vector<scene::Viewpoint> gliding_;  // smoothed viewpoints of the guests
  bool is_away_ = false;                   // the viewpoint depends on a guest, or moves back
};

}  // namespace limn::session
