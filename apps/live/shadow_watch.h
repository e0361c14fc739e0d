#pragma once

#include <optional>
#include <vector>

#include "apps/live/shown_pictures.h"
#include "apps/live/watcher.h"
#include "core/rig.h"
#include "projector/arriving.h"
#include "projector/renderer.h"
#include "scene/posed.h"

namespace limn::apps {

/// Light lost to somebody's shadow, found in the cameras' frames and given to the renderer to make up for.
class ShadowWatch {
 public:
  explicit ShadowWatch(const Rig& rig);

  /// Takes in frames that were not seen yet and tells the renderer how much of each projector's light
  /// arrives. Nothing happens without a prototype in `posed`.
  void look(const Watched& watched,
            const scene::PosedScene& posed,
            const ShownPictures& shown,
            projector::Renderer* renderer);

 private:
  Rig rig_;
  projector::ArrivingLight arriving_;
  std::vector<Stamp> seen_at_;  // newest frame of each camera
  std::optional<Pose> placed_;  // world_from_prototype that the patches are for
};

}  // namespace limn::apps
