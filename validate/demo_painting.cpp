#include "validate/demo_painting.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "projector/renderer.h"
#include "sim/sensor_model.h"
#include "sim/trace.h"

namespace limn::validate {
namespace {

constexpr double k_dim = 0.03;      // share of the room's usual light that is left
constexpr double k_exposure = 2.8;  // factor on the camera's usual exposure

// Where the designer stands and looks, in the door's frame (x right, y up, z towards the viewer).
const Eigen::Vector3d k_p_painter(-0.5, 0.12, 1.2), k_p_painted(0.02, -0.01, -0.02);
constexpr int k_photo_width = 1280, k_photo_height = 800;
constexpr double k_photo_fov_deg = 32;

Imager painter_view(const Pose& world_from_door) {
  const Pose viewer_from_door = looking_at(k_p_painter, k_p_painted, Eigen::Vector3d::UnitY());
  return viewer_imager(world_from_door * viewer_from_door.inverse(), k_photo_width, k_photo_height,
                       k_photo_fov_deg);
}

double eased(double share) {
  const double x = std::clamp(share, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

// 1 within `half` of the middle, falling to 0 over the width `edge`.
double between(double x, double middle, double half, double edge) {
  return eased((half - std::abs(x - middle)) / edge + 0.5);
}

// The light of a photographer's studio: dark, with a long soft box overhead, a window and a low strip of
// light. Degrees above the horizon, and to the right of the door's axis as seen from the door.
Eigen::Vector3d studio_light(double up_deg, double right_deg) {
  const Eigen::Vector3d floor(0.012, 0.012, 0.011), wall(0.1, 0.11, 0.125), ceiling(0.06, 0.065, 0.075);
  const Eigen::Vector3d soft_box(4.5, 4.5, 4.4), window(1.6, 1.9, 2.3), strip(0.5, 0.46, 0.4);
  const Eigen::Vector3d& far = up_deg < 0 ? floor : ceiling;
  const double far_share = up_deg < 0 ? eased(-up_deg / 12) : eased(up_deg / 50);
  return wall + far_share * (far - wall) +
         between(up_deg, 38, 9, 4) * between(right_deg, 0, 75, 20) * soft_box +
         between(up_deg, 12, 14, 3) * between(right_deg, 62, 16, 3) * window +
         between(up_deg, -22, 4, 3) * between(right_deg, 10, 60, 12) * strip;
}

// The studio as a picture, whose middle lies in front of the door.
scene::RoomImage studio(const Pose& world_from_door) {
  scene::RoomImage image;
  image.light.create(256, 512, CV_32FC3);
  for (int row = 0; row < image.light.rows; ++row)
    for (int column = 0; column < image.light.cols; ++column) {
      const Eigen::Vector3d rgb = studio_light(90 - 180 * (row + 0.5) / image.light.rows,
                                               360 * (column + 0.5) / image.light.cols - 180);
      image.light.at<cv::Vec3f>(row, column) = cv::Vec3d(rgb.z(), rgb.y(), rgb.x());
    }
  // Seen from the door, its own right is on the left.
  const Eigen::Matrix3d image_from_door = Eigen::Vector3d(-1, 1, 1).asDiagonal();
  image.image_from_world = image_from_door * world_from_door.rotation.inverse().toRotationMatrix();
  return image;
}

// The world in little light, photographed by the designer.
sim::World dimmed(const sim::World& world, const Imager& camera) {
  sim::World dim = world;
  dim.room.ambient *= k_dim;
  for (sim::Lamp& lamp : dim.room.lamps) lamp.illuminance_at_1m *= k_dim;
  dim.rig.cameras = {camera};
  dim.camera_effects.resize(1);
  sim::CameraEffects& effects = dim.camera_effects[0];
  effects.colour = effects.srgb = true;
  effects.exposure *= k_exposure;
  effects.black_level = 0;
  return dim;
}

}  // namespace

Result<std::vector<DemoImage>> painted_images(const DemoPainting& painting) {
  const sim::World world = dimmed(*painting.world, painter_view(painting.world->world_from_prototype));
  const sim::Samples samples = sim::trace(world, 0);
  scene::PosedScene posed = painting.posed;
  const Pose& world_from_door = *posed.world_from_prototype;
  scene::Scene scene = *painting.scene;
  scene.room_image = studio(world_from_door);
  posed.finish = scene.finishes.at(0).name;
  posed.light.emplace();
  posed.light->image_strength = 1;
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(scene, *painting.rig));
  LIMN_TRY_STATUS(renderer.set_light({.compensation = projector::Compensation::geometry}));
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < painting.rig->projectors.size(); ++i)
    images.push_back(renderer.projector_image(i, posed, painter_view(world_from_door)));
  return std::vector<DemoImage>{
      {"dim", "A dim room", "The clay door without projected light, from the designer's viewpoint.",
       sim::photograph(world, samples, {}, world.seed)},
      {"painted", "Painted in light",
       "The same door in blue lacquer, with the mirror and the trim line on it. For the designer's viewpoint "
       "the lacquer mirrors a photographer's studio.",
       sim::photograph(world, samples, images, world.seed)}};
}

}  // namespace limn::validate
