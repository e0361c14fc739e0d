#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/imager.h"
#include "core/rig.h"
#include "projector/composite_policy.h"
#include "projector/renderer.h"
#include "projector/stereo_cameras.h"
#include "scene/part_boxes.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "session/frame_input.h"
#include "session/screen_request.h"

namespace limn::session {

/// A camera's newest frame, and the tracks at its stamp, assigned to slots as the show state pairs markers.
struct TrackedFrame {
  const Frame& frame;
  std::vector<Track> tracks;
};

/// The input for a screen's image.
struct ScreenInput {
  std::span<const TrackedFrame> cameras;  ///< in the rig's order
  const scene::ShowState& show_state;
  const Imager& viewer;  ///< viewpoint that `view` parts are drawn for; width 0: the screen camera's
  const scene::PosedScene& shown;  ///< the scene as it is projected; parts at rest are drawn at its poses
};

/// Composes images for screens that stand beside the prototype, or around it. Remembers the last composite
/// policies, so that parts do not flicker.
class ScreenComposer {
 public:
  /// Borrows scene, rig and boxes. `prototype_box`: in the prototype's frame.
  ScreenComposer(const scene::Scene* scene,
                 const Rig* rig,
                 const ComposeOptions& options,
                 const Eigen::AlignedBox3d& prototype_box,
                 const scene::PartBoxes* part_boxes);

  /// Images for one eye or two. For two eyes: `view` and `stereo` as seen by the viewer's eyes; what is drawn
  /// over a camera's image comes from two cameras where the rig has two that fit (projector::StereoCameras),
  /// otherwise both eyes get the same. A wall shows the view through it instead of `rest`, `full`, `view` and
  /// `stereo`. Empty before the first frame, for Screen::off, and where the viewer is behind the wall.
  EyeImages images(const ScreenInput& input, const ScreenRequest& request, projector::Renderer* renderer);

 private:
  using Draw = std::function<cv::Mat(const scene::PosedScene&)>;
  EyeImages composites(const ScreenInput& input, const ScreenRequest& request, projector::Renderer* renderer);
  EyeImages views(const ScreenInput& input,
                  const ScreenRequest& request,
                  projector::Renderer* renderer) const;
  cv::Mat camera_image(const ScreenInput& input,
                       std::size_t camera,
                       scene::Screen what,
                       projector::Renderer* renderer) const;
  void update_policies(const ScreenInput& input, std::size_t camera, projector::Renderer* renderer);
  scene::PosedScene posed(const ScreenInput& input, std::size_t camera) const;
  cv::Mat with_split(const ScreenInput& input,
                     std::size_t camera,
                     const Imager& seen_from,
                     const Draw& draw,
                     const Draw& draw_other) const;
  const std::optional<projector::StereoCameras>& stereo_cameras();
  // The camera whose images are shown to one eye. A rig without cameras has no images.
  std::size_t screen_camera() const { return rig_->first_visible_camera(); }

  const scene::Scene* scene_;
  const Rig* rig_;
  ComposeOptions options_;
  Eigen::AlignedBox3d prototype_box_;
  const scene::PartBoxes* part_boxes_;
  std::vector<projector::CompositePolicy> policies_;
  Stamp treated_at_;
  bool has_looked_for_cameras_ = false;  // stereo_cameras_ is set
  std::optional<projector::StereoCameras> stereo_cameras_;
};

}  // namespace limn::session
