#pragma once

#include <optional>
#include <vector>

#include "core/imager.h"
#include "projector/resources.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::projector {

/// The light that parts are shaded by (shaders/shading.glsl): the room's light if it is known, else soft
/// light and a lamp that move with the viewer; and the scene's picture of the room.
class RoomLighting final : public Bindable {
 public:
  explicit RoomLighting(const scene::Scene& scene);
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
  Eigen::Matrix3d image_from_world_ = Eigen::Matrix3d::Identity();
  GlName image_;  // levels of room_image_levels(), one a layer; no texture without a picture
  float image_strength_ = 0;
  Eigen::Matrix3f image_from_scene_;
};

}  // namespace limn::projector
