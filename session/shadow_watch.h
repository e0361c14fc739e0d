#pragma once

#include <optional>
#include <vector>

#include "core/rig.h"
#include "projector/renderer.h"
#include "projector/shadow_detector.h"
#include "scene/posed_scene.h"
#include "session/perception.h"
#include "session/projection_history.h"

namespace limn::apps {

/// Light lost to somebody's shadow, found in the cameras' frames and given to the renderer to make up for.
class ShadowWatch {
 public:
  explicit ShadowWatch(const Rig& rig);

  /// Takes in frames that were not seen yet and tells the renderer how much of each projector's light
  /// arrives. Nothing happens without a prototype in `posed`.
  void look(const Percepts& watched,
            const scene::PosedScene& posed,
            const ProjectionHistory& shown,
            projector::Renderer* renderer);

 private:
  Rig rig_;
  projector::ShadowDetector arriving_;
  std::vector<Stamp> seen_at_;  // newest frame of each camera
  std::optional<Pose> placed_;  // world_from_prototype that the patches are for
};

}  // namespace limn::apps
