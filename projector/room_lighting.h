#pragma once

#include <optional>
#include <vector>

#include "core/imager.h"
#include "projector/resources.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::projector {

/// The light that parts are shaded by (shaders/shading.glsl): the room's light if it is known, else soft
/// light and a lamp that move with the viewer.
class RoomLighting final : public Bindable {
 public:
  explicit RoomLighting(const std::optional<scene::RoomLight>& room);
  /// Sets the light for the next drawing.
  void place(const scene::PosedScene& posed, const Pose& scene_from_world, const Imager& viewer);
  /// Binds Resource::room_light.
  void bind(const Use& use) const override;

 private:
  std::optional<scene::RoomLight> room_;
  scene::RoomLight viewer_light_;  // used where no room light is known
  bool has_room_light_ = false;
  Eigen::Vector4f d_up_, soft_below_, soft_above_;  // scene frame
  std::vector<Eigen::Vector4f> d_lamps_, lamps_;
};

}  // namespace limn::projector
