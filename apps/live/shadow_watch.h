#pragma once

#include <deque>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "apps/live/watcher.h"
#include "core/rig.h"
#include "projector/arriving.h"
#include "projector/renderer.h"
#include "scene/posed.h"

namespace limn::apps {

/// Light lost to somebody's shadow, found in the cameras' frames and given to the renderer to make up for:
/// keeps what was shown when, so that each frame is compared with the pictures that lit it.
class ShadowWatch {
 public:
  explicit ShadowWatch(const Rig& rig);

  /// Takes in frames that were not seen yet and tells the renderer how much of each projector's light
  /// arrives. Nothing happens without a prototype in `posed`.
  void look(const Watched& watched, const scene::PosedScene& posed, projector::Renderer* renderer);

  /// What the projectors show from a moment on.
  void showed(const std::vector<cv::Mat>& pictures, Stamp shown_at);

 private:
  struct Shown {
    std::vector<cv::Mat> pictures;
    Stamp at;
  };
  const std::vector<cv::Mat>* shown_at(Stamp at) const;

  Rig rig_;
  projector::ArrivingLight arriving_;
  std::deque<Shown> shown_;     // oldest first
  std::vector<Stamp> seen_at_;  // newest frame of each camera
  std::optional<Pose> placed_;  // world_from_prototype that the patches are for
};

}  // namespace limn::apps
