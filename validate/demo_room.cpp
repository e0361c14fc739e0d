#include "validate/demo_room.h"

#include "sim/sensor_model.h"

namespace limn::validate {
namespace {

constexpr double k_dim = 0.03;      // share of the room's usual light that is left
constexpr double k_exposure = 2.8;  // factor on the camera's usual exposure

// Where the designer stands and looks, in the door's frame (x right, y up, z towards the viewer).
const Eigen::Vector3d k_p_painter(-0.5, 0.12, 1.2), k_p_painted(0.02, -0.01, -0.02);
constexpr int k_photo_width = 1280, k_photo_height = 800;
constexpr double k_photo_fov_deg = 32;

// The world in little light, photographed by the designer.
sim::World dimmed(const sim::World& world) {
  sim::World dim = world;
  dim.room.ambient *= k_dim;
  for (sim::Lamp& lamp : dim.room.lamps) lamp.illuminance_at_1m *= k_dim;
  dim.rig.cameras = {painter_view(world.world_from_prototype)};
  dim.camera_effects.resize(1);
  sim::CameraEffects& effects = dim.camera_effects[0];
  effects.colour = effects.srgb = true;
  effects.exposure *= k_exposure;
  effects.black_level = 0;
  return dim;
}

}  // namespace

Imager painter_view(const Pose& world_from_door) {
  const Pose viewer_from_door = looking_at(k_p_painter, k_p_painted, Eigen::Vector3d::UnitY());
  return viewer_imager(world_from_door * viewer_from_door.inverse(), k_photo_width, k_photo_height,
                       k_photo_fov_deg);
}

DimRoom::DimRoom(const sim::World& world) : world_(dimmed(world)), samples_(sim::trace(world_, 0)) {}

cv::Mat DimRoom::photograph(const std::vector<cv::Mat>& projected) const {
  return sim::photograph(world_, samples_, projected, world_.seed);
}

std::vector<cv::Mat> painter_images(const DemoSubject& subject, const scene::PosedScene& posed) {
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < subject.rig->projectors.size(); ++i)
    images.push_back(subject.renderer->projector_image(i, posed, painter_view(*posed.world_from_prototype)));
  return images;
}

}  // namespace limn::validate
