#include "tests/remote/virtual_tablet.h"

#include <cmath>
#include <numbers>

#include "device/jpeg.h"
#include "sim/sensor_model.h"
#include "sim/trace.h"

namespace limn::test {
namespace {

constexpr int k_quality = 80;  // of JPEG

}  // namespace

VirtualTablet::VirtualTablet(
    sim::World world, std::vector<cv::Mat> shown, int width, int height, std::uint64_t seed)
    : world_(std::move(world)), shown_(std::move(shown)), seed_(seed) {
  std::mt19937_64 rng(seed);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng);
  };
  const double focal = 0.5 * width / std::tan(0.5 * between(63, 67) * std::numbers::pi / 180);
  Imager camera;
  camera.name = "tablet";
  camera.width = width;
  camera.height = height;
  camera.lens =
      Lens::create("LENSMODEL_OPENCV4", {focal, focal, 0.5 * (width - 1) + between(-0.015, 0.015) * width,
                                         0.5 * (height - 1) + between(-0.015, 0.015) * width,
                                         between(-0.08, 0.08), between(-0.04, 0.04), 0, 0})
          .value();
  world_.rig.cameras = {camera};
  world_.camera_effects = {{.colour = true,
                            .exposure = 0.57,
                            .psf_px = 0.6,
                            .vignetting = 0.1,
                            .full_well_e = 8000,
                            .read_noise = 1,
                            .srgb = true}};
  for (sim::Lamp& lamp : world_.room.lamps) lamp.radius_m = 0;  // hard shadows are traced sooner
  for (double& phase : phases_) phase = between(0, 2 * std::numbers::pi);
}

TabletShot VirtualTablet::shoot(double at_s) {
  const auto wave = [&](int i, double period_s) {
    return std::sin(2 * std::numbers::pi * at_s / period_s + phases_[i]);
  };
  const double side = 0.75 * wave(0, 7), height = 0.35 * wave(1, 5), distance = 0.7 + 0.15 * wave(2, 9);
  const Eigen::Vector3d p_middle = world_.world_from_prototype.translation;
  const Eigen::Vector3d p_eye =
      p_middle + distance * Eigen::Vector3d(std::sin(side) * std::cos(height),
                                            -std::cos(side) * std::cos(height), std::sin(height));
  const Eigen::Vector3d p_target = p_middle + Eigen::Vector3d(0.08 * wave(3, 3), 0, 0.06 * wave(4, 4));
  return shoot_from(looking_at(p_eye, p_target, {0.15 * wave(5, 6), 0, 1}));
}

TabletShot VirtualTablet::shoot_from(const Pose& camera_from_world) {
  world_.rig.cameras[0].imager_from_world = camera_from_world;
  TabletShot shot{{}, {}, world_.rig.cameras[0]};
  shot.image = sim::photograph(world_, sim::trace(world_, 0), shown_, seed_ + ++shots_);
  shot.jpeg = device::encode_jpeg(shot.image, k_quality);
  return shot;
}

}  // namespace limn::test
