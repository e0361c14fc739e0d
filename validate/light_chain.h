#pragma once

#include <span>

#include "core/marker.h"
#include "core/result.h"
#include "core/rig.h"
#include "scene/scene.h"
#include "sim/world.h"
#include "tracker/detection.h"
#include "validate/metrics.h"

namespace limn::validate {

/// Dots all over the true world's prototype.
TargetDots dots_on_prototype(const sim::World& world);

/// Draws the dots with a renderer that knows `rig` and the prototype's place in that rig's world, and
/// compares their light with the true world's points. `scene` gives the prototype. Error: no GPU or software
/// OpenGL.
Result<Registration> judge_light(const scene::Scene& scene,
                                 const Rig& rig,
                                 const sim::World& world,
                                 const TargetDots& dots,
                                 const Pose& world_from_prototype);

/// RMS distance of the light from where it is aimed, mm, when one stage is the session's and the others are
/// true: what each stage adds to the error of the whole chain. The stages' errors are nearly independent, so
/// that their squares add up to about that of the whole chain.
struct LightChain {
  double rendering_mm = 0;  ///< everything else is true
  double prototype_pose_mm =
      0;  ///< also the pose that the tracker finds from the true corners of the markers
  double marker_corners_mm = 0;  ///< also the corners that it finds in the image
  double calibration_mm = 0;     ///< the calibrated rig, and a pose from true corners
};

/// `detections` are those of camera 0. Error: as judge_light, or the corners give no pose.
Result<LightChain> light_chain(const scene::Scene& scene,
                               const Rig& calibrated,
                               const sim::World& world,
                               const TargetDots& dots,
                               std::span<const Body> bodies,
                               std::span<const tracker::Detection> detections);

}  // namespace limn::validate
