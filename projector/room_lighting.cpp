#include "projector/room_lighting.h"

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "projector/bindings.h"
#include "projector/room_image_levels.h"

namespace limn::projector {
namespace {

// The light used where no room light is known: soft light and a lamp, which stands above and behind the
// viewer's left shoulder (viewer's frame).
constexpr double k_soft_below = 0.15, k_soft_above = 0.35, k_lamp = 0.65;
const Eigen::Vector3d k_d_lamp_viewer = Eigen::Vector3d(-0.36, -0.64, -0.68).normalized();

Eigen::Vector4f homogeneous(const Eigen::Vector3d& v) { return v.cast<float>().homogeneous(); }

// The levels as a texture whose third coordinate is the level.
GlName level_texture(const cv::Mat& light) {
  const std::vector<cv::Mat> levels = room_image_levels(light);
  const int width = levels[0].cols, height = levels[0].rows;
  GlName texture = make_texture(GL_TEXTURE_3D, GL_RGBA16F, width, height, static_cast<int>(levels.size()));
  for (std::size_t k = 0; k < levels.size(); ++k) {
    cv::Mat rgba;
    cv::cvtColor(levels[k], rgba, cv::COLOR_BGR2RGBA);
    glTextureSubImage3D(*texture, 0, 0, 0, static_cast<GLint>(k), width, height, 1, GL_RGBA, GL_FLOAT,
                        rgba.data);
  }
  for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTextureParameteri(*texture, filter, GL_LINEAR);
  glTextureParameteri(*texture, GL_TEXTURE_WRAP_S, GL_REPEAT);
  return texture;
}

}  // namespace

RoomLighting::RoomLighting(const scene::Scene& scene) : room_(scene.light) {
  if (scene.room_image) {
    image_from_world_ = scene.room_image->image_from_world;
    image_ = level_texture(scene.room_image->light);
  }
  viewer_light_.below_rgb.setConstant(k_soft_below);
  viewer_light_.above_rgb.setConstant(k_soft_above);
  viewer_light_.lamps.resize(1);
  viewer_light_.lamps[0].strength_rgb.setConstant(k_lamp);
}

void RoomLighting::place(const scene::PosedScene& posed, const Pose& scene_from_world, const Imager& viewer) {
  const Eigen::Quaterniond world_from_viewer = viewer.imager_from_world.rotation.inverse();
  viewer_light_.d_up_world = world_from_viewer * -Eigen::Vector3d::UnitY();
  viewer_light_.lamps[0].d_world = world_from_viewer * k_d_lamp_viewer;
  const std::optional<scene::RoomLight>& known = posed.light ? posed.light : room_;
  const scene::RoomLight& light = known ? *known : viewer_light_;
  has_room_light_ = known.has_value();
  d_up_ = homogeneous(scene_from_world.rotation * light.d_up_world);
  soft_below_ = homogeneous(light.below_rgb);
  soft_above_ = homogeneous(light.above_rgb);
  image_strength_ = image_ ? static_cast<float>(light.image_strength) : 0.0F;
  image_from_scene_ =
      (image_from_world_ * scene_from_world.rotation.inverse().toRotationMatrix()).cast<float>();
  d_lamps_.clear();
  lamps_.clear();
  for (const auto& lamp : light.lamps) {
    d_lamps_.push_back(homogeneous(scene_from_world.rotation * lamp.d_world));
    lamps_.push_back(homogeneous(lamp.strength_rgb));
  }
}

void RoomLighting::bind(const Use& use) const {
  use.program.set("u_has_room_light", has_room_light_);
  use.program.set("u_d_up", d_up_);
  use.program.set("u_soft_below", soft_below_);
  use.program.set("u_soft_above", soft_above_);
  use.program.set("u_lamp_count", static_cast<int>(lamps_.size()));
  use.program.set_vectors("u_d_lamps", d_lamps_);
  use.program.set_vectors("u_lamps", lamps_);
  if (!image_) return;
  use.program.set("u_image_strength", image_strength_);
  use.program.set("u_image_from_scene", image_from_scene_);
  glBindTextureUnit(static_cast<GLuint>(k_room_image_unit), *image_);
}

}  // namespace limn::projector
