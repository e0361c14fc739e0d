#pragma once

#include <optional>
#include <vector>

#include "core/rig.h"
#include "projector/renderer.h"
#include "projector/shadow_detector.h"
#include "scene/posed_scene.h"
#include "session/perception.h"
#include "session/projection_history.h"

namespace limn::session {

/// Finds light that people block, from the cameras' frames. Other projectors fill it in
/// (Renderer::set_occlusion).
class ShadowWatch {
 public:
  explicit ShadowWatch(const Rig& rig);

  /// Processes new frames. Does nothing without a prototype in `posed`.
  void update(const Percepts& percepts,
              const scene::PosedScene& posed,
              const ProjectionHistory& shown,
              projector::Renderer* renderer);

  /// How much of each projector's light arrives: FrameDescription::arriving.
  const std::vector<cv::Mat>& maps() const { return maps_; }

 private:
  Rig rig_;
  projector::ShadowDetector arriving_;
  std::vector<Stamp> seen_at_;  // stamp of each camera's newest processed frame
  std::vector<cv::Mat> maps_;
  std::optional<Pose> placed_;  // world_from_prototype for which the patches were made
};

}  // namespace limn::session
