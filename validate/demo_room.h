#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/rig.h"
#include "projector/renderer.h"
#include "scene/posed_scene.h"
#include "session/deviation/prototype_comparison.h"
#include "sim/trace.h"
#include "sim/world.h"
#include "validate/demo_page.h"

namespace limn::validate {

/// What the demo's images of the dim room need.
struct DemoSubject {
  const scene::Scene* scene = nullptr;
  const Rig* rig = nullptr;                 ///< As calibrated.
  const sim::World* world = nullptr;        ///< The truth, in its usual light.
  projector::Renderer* renderer = nullptr;  ///< For scene and rig, on white clay.
  scene::PosedScene posed = {};             ///< As tracked.
  std::vector<session::SeenMarker> markers = {};
};

/// The designer, who stands to the left of the door.
Imager painter_view(const Pose& world_from_door);

/// The demo's room in little light, as the designer photographs it.
class DimRoom {
 public:
  explicit DimRoom(const sim::World& world);
  /// A photograph while these images are projected; empty: none.
  cv::Mat photograph(const std::vector<cv::Mat>& projected) const;

 private:
  sim::World world_;
  sim::Samples samples_;
};

/// The images of all projectors for the designer.
std::vector<cv::Mat> painter_images(const DemoSubject& subject, const scene::PosedScene& posed);

}  // namespace limn::validate
