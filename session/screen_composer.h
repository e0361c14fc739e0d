#pragma once

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "core/imager.h"
#include "core/rig.h"
#include "projector/composite_policy.h"
#include "projector/renderer.h"
#include "scene/part_boxes.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "session/frame_input.h"

namespace limn::session {

/// The input for a screen's image.
struct ScreenInput {
  const Frame& frame;  ///< the newest of Percepts::screen_camera
  const scene::ShowState& show_state;
  std::vector<Track> tracks;  ///< at that frame's stamp, assigned to slots as the show state pairs markers
  const Imager& viewer;       ///< viewpoint that `view` parts are drawn for; width 0: that camera's
  const scene::PosedScene& shown;  ///< the scene as it is projected; parts at rest are drawn at its poses
};

/// Composes images for screens that stand beside the prototype. Remembers the last composite policies, so
/// that parts do not flicker.
class ScreenComposer {
 public:
  /// Borrows scene, rig and boxes. `prototype_box`: in the prototype's frame.
  ScreenComposer(const scene::Scene* scene,
                 const Rig* rig,
                 const ComposeOptions& options,
                 const Eigen::AlignedBox3d& prototype_box,
                 const scene::PartBoxes* part_boxes);

  /// Empty before the first frame and for Screen::off.
  cv::Mat image(const ScreenInput& input, scene::Screen what, projector::Renderer* renderer);

 private:
  // The camera whose images are shown. A rig without cameras has no images.
  const Imager& screen_camera() const { return rig_->cameras[rig_->first_visible_camera()]; }
  cv::Mat composed(const cv::Mat& behind,
                   const scene::PosedScene& posed,
                   const Imager& viewer,
                   scene::Screen what,
                   std::span<const projector::CompositePolicy> policies,
                   projector::Renderer* renderer) const;

  const scene::Scene* scene_;
  const Rig* rig_;
  ComposeOptions options_;
  Eigen::AlignedBox3d prototype_box_;
  const scene::PartBoxes* part_boxes_;
  std::vector<projector::CompositePolicy> policies_;
  Stamp treated_at_;
};

}  // namespace limn::session
