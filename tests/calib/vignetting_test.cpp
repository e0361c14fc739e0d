#include "calib/response/vignetting.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "sim/sensor_model.h"
#include "tests/sim/small_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;

constexpr double k_camera_loss = 0.15, k_projector_loss = 0.25;

// Light of a white wall at some distances and tilts, with geometry divided out and the sensor's noise.
std::vector<PaperLight> photographed_walls(std::span<const double> distances_m) {
  sim::World world = small_world();
  world.camera_effects[0] = {
      .exposure = 0.5, .vignetting = k_camera_loss, .full_well_e = 10000, .read_noise = 0.6};
  world.projector_effects[0].vignetting = k_projector_loss;
  const cv::Mat white[] = {cv::Mat(150, 200, CV_8U, cv::Scalar(255))},
                black[] = {cv::Mat::zeros(150, 200, CV_8U)};
  std::vector<PaperLight> light;
  std::uint64_t shot = 0;
  for (const double distance : distances_m) {
    const double tilt = 0.5 * std::sin(7 * distance);
    Pose& wall = world.objects[0].world_from_object;
    wall = facing_minus_y(0, distance, 0);
    wall.rotation = exp_rotation({0.3 * std::cos(5 * distance), 0, tilt}) * wall.rotation;
    const sim::Samples samples = sim::trace(world, 0);
    const cv::Mat lit = sim::photograph(world, samples, white, ++shot),
                  dark = sim::photograph(world, samples, black, ++shot);
    for (int y = 3; y < 240; y += 6)
      for (int x = 3; x < 320; x += 6) {
        const sim::ProjectorView& view = samples.projectors[0][static_cast<size_t>(y * 320 + x)];
        const bool inside = view.gain > 0 && view.u > 2 && view.v > 2 && view.u < 197 && view.v < 147;
        if (!inside || lit.at<uchar>(y, x) > 250) continue;
        const double difference = lit.at<uchar>(y, x) - dark.at<uchar>(y, x);
        if (difference > 5) light.push_back({0, 0, {x, y}, {view.u, view.v}, difference / view.gain});
      }
  }
  return light;
}

RigResponses found_in(const std::vector<PaperLight>& light) {
  RigResponses responses;
  responses.cameras.resize(1);
  responses.cameras[0].camera = "camera0";
  responses.projectors.resize(1);
  responses.projectors[0].projector = "projector0";
  add_vignetting(light, {{"camera0", 320, 240}}, {{"projector0", 200, 150}}, &responses);
  return responses;
}

// The largest difference over an image; both are 1 in the centre.
double worst_error(const Vignetting& found, double loss, int width, int height) {
  double worst = 0;
  const Eigen::Vector2d middle((width - 1) / 2.0, (height - 1) / 2.0);
  for (int y = 0; y < height; y += 5)
    for (int x = 0; x < width; x += 5) {
      const double r2 =
          (Eigen::Vector2d(x, y) - middle).squaredNorm() * 4 / (width * width + height * height);
      worst = std::max(worst, std::abs(found.gain({x, y}, width, height) - (1 - loss * r2)));
    }
  return worst;
}

TEST(Vignetting, OfCameraAndProjectorAreToldApartByManyPlaces) {
  const double distances[] = {0.7, 0.85, 1.0, 1.2, 1.45, 1.7};
  const RigResponses found = found_in(photographed_walls(distances));
  ASSERT_TRUE(found.cameras[0].vignetting && found.projectors[0].vignetting);
  const double camera = worst_error(*found.cameras[0].vignetting, k_camera_loss, 320, 240),
               projector = worst_error(*found.projectors[0].vignetting, k_projector_loss, 200, 150);
  EXPECT_LT(camera, 0.02);
  EXPECT_LT(projector, 0.02);
  EXPECT_LT(found.cameras[0].vignetting->corner_stddev, 0.02);
  fmt::print("camera {:.4f} (stated {:.4f}), projector {:.4f} (stated {:.4f})\n", camera,
             found.cameras[0].vignetting->corner_stddev, projector,
             found.projectors[0].vignetting->corner_stddev);
}

TEST(Vignetting, ASmudgeOnTheBoardIsLeftOut) {
  const double distances[] = {0.7, 0.85, 1.0, 1.2, 1.45, 1.7};
  std::vector<PaperLight> light = photographed_walls(distances);
  for (size_t i = 0; i < light.size(); i += 12) light[i].light *= 0.6;
  const RigResponses found = found_in(light);
  EXPECT_LT(worst_error(*found.projectors[0].vignetting, k_projector_loss, 200, 150), 0.02);
}

TEST(Vignetting, IsNotMadeOfAFewPlaces) {
  std::vector<PaperLight> light = photographed_walls(std::array{1.0});
  light.resize(30);
  EXPECT_FALSE(found_in(light).cameras[0].vignetting.has_value());
}

}  // namespace
}  // namespace limn::calib
