// A person's shadow on the prototype, and how other projectors fill it.
#include "projector/shadow_detector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "projector/renderer.h"
#include "sim/sensor_model.h"
#include "sim/truth.h"
#include "tests/projector/gl_test.h"
#include "tests/sim/small_world.h"
#include "tests/support/matchers.h"
#include "tests/support/meshes.h"

namespace limn::projector {
namespace {

using Eigen::Vector3d;

class ArrivingTest : public test::GlTest {};

TEST_F(ArrivingTest, OthersGiveTheLightOfABlockedProjector) {
  // The projectors stand side by side, so that a point's pixels in the two images are 320 pixels apart.
  constexpr int k_shift = 320;
  Rig rig;
  for (const double x : {-0.2, 0.2}) {
    rig.projectors.push_back({x < 0 ? "projector0" : "projector1", 640, 400,
                              Lens::pinhole(800, 800, 320, 200),
                              Pose(Eigen::Quaterniond::Identity(), -Vector3d(x, 0, -1))});
  }
  scene::Scene scene;
  scene.prototype = scene::Prototype{test::sheet(1.1, 0.7, 0, 1), {}, 0.8, {}};
  const scene::PosedScene posed{Pose(), {}};
  auto drawing = Renderer::create(scene, rig);
  ASSERT_TRUE(drawing) << drawing.message();
  const cv::Mat before = drawing->blend(0, posed);

  // The upper rows are blocked and the lower rows are free; the change is over one of 20 cells.
  cv::Mat map(20, 8, CV_8U, cv::Scalar(255));
  map.rowRange(0, 10).setTo(0);
  drawing->set_occlusion(0, map);
  const cv::Mat own = drawing->blend(0, posed), other = drawing->blend(1, posed);
  constexpr int k_cell = 400 / 20, k_half_ramp = k_cell / 2;
  int blocked = 0, alone = 0;
  for (int row = 0; row < own.rows; ++row) {
    for (int column = 0; column < own.cols; ++column) {
      const float share = own.at<cv::Vec2f>(row, column)[0], full = before.at<cv::Vec2f>(row, column)[0];
      if (full == 0) continue;  // beside the sheet
      if (column < k_shift) {
        EXPECT_NEAR(share, 1, 1e-6) << row << " " << column;  // no other projector reaches
        ++alone;
        continue;
      }
      const float rest = other.at<cv::Vec2f>(row, column - k_shift)[0];
      const bool reached_well = 1 - full > 0.02F;  // not at the border of the other projector's image
      if (row < 200 - k_half_ramp && reached_well) {
        EXPECT_GT(rest, 0.94F) << row << " " << column;
        EXPECT_NEAR(share, std::max(0.07F * std::min(1.0F, 4 * full), 1 - rest), 1e-4)
            << row << " " << column;
        ++blocked;
      } else if (row >= 200 + k_half_ramp) {
        EXPECT_NEAR(share, full, 1e-3) << row << " " << column;
      }
      EXPECT_LT(share + rest, 1.0705F);  // no flash when the shadow goes
      EXPECT_GT(share + rest, 0.998F);
      const float above = row > 100 && row < 300 ? own.at<cv::Vec2f>(row - 1, column)[0] : share;
      EXPECT_LT(std::abs(share - above), 0.12F) << row << " " << column;
    }
  }
  EXPECT_GT(blocked, 30000);
  EXPECT_GT(alone, 50000);

  drawing->set_occlusion(0, {});
  EXPECT_EQ(cv::norm(cv::Mat(drawing->blend(0, posed)), before, cv::NORM_INF), 0);
}

// A wall in a room with light, two projectors of different brightness, and a grey sRGB camera without a
// measured response.
class Room {
 public:
  Room() {
    world.rig.cameras[0] = {"camera0", 640, 480, Lens::pinhole(900, 900, 319.5, 239.5),
                            looking_at({0.03, 0.02, 0.05}, {0, 1, 0}, Vector3d::UnitZ())};
    const auto projector = [](const char* name, const Vector3d& p_viewpoint) {
      return Imager{name, 320, 200,
                    Lens::create("LENSMODEL_OPENCV4", {500, 500, 160, 102, -0.05, 0.01, 1e-4, 2e-4}).value(),
                    looking_at(p_viewpoint, {0, 1, 0}, Vector3d::UnitZ())};
    };
    world.rig.projectors = {projector("projector0", {-0.4, -0.05, 0.12}),
                            projector("projector1", {0.35, 0.1, 0.05})};
    world.camera_effects[0] = {
        .exposure = 0.5, .psf_px = 0.5, .full_well_e = 12000, .read_noise = 0.5, .srgb = true};
    world.projector_effects.assign(2, {.illuminance_at_1m = 1.3, .gamma = 2.2});
    world.projector_effects[1].illuminance_at_1m = 1.1;
    world.room.ambient = 0.08;
    world.world_from_prototype = test::facing_minus_y(0, 1, 0);
    world.objects.clear();
    sim::Object wall;
    wall.name = "prototype";
    wall.mesh = std::make_shared<scene::Mesh>(test::sheet(0.5, 0.36, 0, 1));
    wall.world_from_object = world.world_from_prototype;
    wall.albedo = {0.35, 0.5, 0.7};
    world.objects.push_back(wall);
    scene.prototype = scene::Prototype{test::sheet(0.5, 0.36, 0, 1), {}, 0.6, {}};
    add_part("coat", 0.5, 0.36);
    add_part("patch", 0.12, 0.12);
    seed = test::test_rng()();
  }

  void add_part(const char* name, double width, double height) {
    scene::Mesh mesh = test::sheet(width, height, 0, 1);
    mesh.materials = {
        scene::Material{.base_colour = Eigen::Vector3f::Constant(0.4F), .unlit = true, .texture = {}}};
    scene::Slot slot;
    slot.name = name;
    slot.mode = scene::Mode::surface;
    slot.variants = {{"a", mesh}};
    scene.slots.push_back(slot);
  }

  void begin(const std::string& part) {
    auto made = Renderer::create(scene, world.rig);
    ASSERT_TRUE(made) << made.message();
    renderer.emplace(std::move(made).value());
    ASSERT_TRUE(renderer->set_light({.compensation = Compensation::geometry}));
    arriving.emplace(world.rig, ShadowDetectorOptions{.cell_px = 10});
    put(part, 0);
    arriving->place(0, renderer->illuminated_patches(0, posed, 8));
    trace({});
    for (int k = 0; k < 2; ++k) frame({cv::Mat(), cv::Mat()});
    for (int k = 0; k < 4; ++k) frame(images());
  }

  void put(const std::string& part, double x) {
    const Pose prototype_from_part(Eigen::Quaterniond::Identity(), Vector3d(x, 0, 0));
    posed = {world.world_from_prototype, {{part, "a", world.world_from_prototype * prototype_from_part}}};
  }

  // A hand on the line from p_viewpoint to p_target, facing along it.
  static sim::Object hand(const Vector3d& p_viewpoint, const Vector3d& p_target, double at) {
    Pose pose = looking_at(p_viewpoint, p_target, Vector3d::UnitZ()).inverse();
    pose.translation = p_viewpoint + at * (p_target - p_viewpoint);
    sim::Object object = sim::sheet("hand", 0.07, 0.09, {}, pose);
    object.albedo = {0.28, 0.4, 0.62};
    return object;
  }
  Vector3d p_viewpoint(const Imager& imager) const { return imager.imager_from_world.inverse().translation; }

  void trace(const std::vector<sim::Object>& hands) {
    world_with_hands = world;
    for (const sim::Object& object : hands) world_with_hands.objects.push_back(object);
    samples = sim::trace(world_with_hands, 0);
  }

  std::vector<cv::Mat> images() {
    std::vector<cv::Mat> out;
    const Imager viewer =
        viewer_imager(looking_at({0, 0, 0}, {0, 1, 0}, Vector3d::UnitZ()).inverse(), 64, 48, 40);
    for (std::size_t i = 0; i < 2; ++i) renderer->set_occlusion(i, arriving->map(i));
    for (std::size_t i = 0; i < 2; ++i) out.push_back(renderer->projector_image(i, posed, viewer));
    return out;
  }

  bool frame(const std::vector<cv::Mat>& shown) {
    return arriving->update_maps(0, sim::photograph(world_with_hands, samples, shown, ++seed), shown);
  }

  sim::World world = test::small_world(), world_with_hands;
  scene::Scene scene;
  scene::PosedScene posed;
  sim::Samples samples;
  std::optional<Renderer> renderer;
  std::optional<ShadowDetector> arriving;
  std::uint64_t seed = 0;
};

TEST_F(ArrivingTest, ShadowIsFoundInOneFrameAndForgottenInTwo) {
  Room room;
  room.begin("coat");
  const Imager& projector = room.world.rig.projectors[0];
  room.trace({Room::hand(room.p_viewpoint(projector), {0, 1, 0}, 0.55)});
  ASSERT_TRUE(room.frame(room.images()));
  for (int k = 0; k < 3; ++k) room.frame(room.images());
  const cv::Mat map = room.arriving->map(0);
  const sim::Truth truth(room.world_with_hands);
  int shaded = 0, lit = 0;
  cv::Mat hand(map.size(), CV_8U, cv::Scalar(0)), wall = hand.clone(), near;
  for (int row = 0; row < map.rows; ++row)
    for (int column = 0; column < map.cols; ++column) {
      const auto landing = truth.landing(projector, {10 * column + 4.5, 10 * row + 4.5});
      if (landing) (landing->object == "hand" ? hand : wall).at<std::uint8_t>(row, column) = 255;
    }
  cv::dilate(hand, near, cv::getStructuringElement(cv::MORPH_RECT, {9, 9}));
  for (int row = 0; row < map.rows; ++row)
    for (int column = 0; column < map.cols; ++column) {
      const float arrives = map.at<float>(row, column);
      if (hand.at<std::uint8_t>(row, column)) {
        EXPECT_EQ(arrives, 0) << row << " " << column;
        ++shaded;
      } else if (wall.at<std::uint8_t>(row, column) && !near.at<std::uint8_t>(row, column)) {
        EXPECT_EQ(arrives, 1) << row << " " << column;
        ++lit;
      }
    }
  EXPECT_GT(shaded, 20);
  EXPECT_GT(lit, 100);
  EXPECT_EQ(cv::norm(cv::Mat(room.arriving->map(1) - 1), cv::NORM_INF), 0);

  room.trace({});
  for (int k = 0; k < 2; ++k) room.frame(room.images());
  EXPECT_EQ(cv::norm(cv::Mat(room.arriving->map(0) - 1), cv::NORM_INF), 0);
}

TEST_F(ArrivingTest, HandBeforeTheCameraIsNoShadow) {
  Room room;
  room.begin("coat");
  const Vector3d p_camera = room.p_viewpoint(room.world.rig.cameras[0]);
  for (int k = 0; k < 4; ++k) {
    room.trace({Room::hand(p_camera, {0.02 * k, 1, 0}, 0.3)});
    EXPECT_FALSE(room.frame(room.images())) << k;
  }
  room.trace({});
  EXPECT_FALSE(room.frame(room.images()));
}

TEST_F(ArrivingTest, NeitherNoiseNorMovingPartsNorALostFrameAreShadows) {
  Room room;
  room.begin("patch");
  for (int k = 0; k < 30; ++k) ASSERT_FALSE(room.frame(room.images())) << k;
  for (int k = 0; k < 12; ++k) {
    room.put("patch", 0.012 * k);
    EXPECT_FALSE(room.frame(room.images())) << k;
  }
  const auto shown = room.images();
  const cv::Mat black(480, 640, CV_8U, cv::Scalar(0));
  room.arriving->update_maps(0, black, shown);
  EXPECT_FALSE(room.frame(room.images()));
  EXPECT_EQ(cv::norm(room.images()[0], shown[0], cv::NORM_INF), 0);
}

TEST_F(ArrivingTest, WhatIsKnownMovesWithThePrototype) {
  Room room;
  room.begin("coat");
  room.world.world_from_prototype = test::facing_minus_y(0.03, 1.02, 0.01);
  room.world.objects[0].world_from_object = room.world.world_from_prototype;
  room.put("coat", 0);
  room.arriving->place(0, room.renderer->illuminated_patches(0, room.posed, 8));
  room.trace({});
  EXPECT_FALSE(room.frame(room.images()));
  room.trace({Room::hand(room.p_viewpoint(room.world.rig.projectors[1]), {0, 1, 0},
                         0.35)});  // the camera does not see it
  EXPECT_TRUE(room.frame(room.images()));
  for (int k = 0; k < 2; ++k) room.frame(room.images());
  EXPECT_GT(cv::countNonZero(room.arriving->map(1) == 0), 20);
}

}  // namespace
}  // namespace limn::projector
