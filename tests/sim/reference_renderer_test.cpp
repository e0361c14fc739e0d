#include "sim/reference_renderer.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "scene/meshes/tangents.h"
#include "tests/support/matchers.h"

namespace limn::sim {
namespace {

constexpr double k_focal_px = 400;
const Eigen::Vector3f k_colour_rgb(0.25F, 0.5F, 0.75F);

scene::Mesh sheet_at(double width, double height, double x, double z) {
  scene::Mesh mesh;
  const auto w = static_cast<float>(width / 2), h = static_cast<float>(height / 2);
  for (const auto& [sx, sy] : {std::pair{-1.0F, -1.0F}, {1.0F, -1.0F}, {1.0F, 1.0F}, {-1.0F, 1.0F}})
    mesh.positions.emplace_back(static_cast<float>(x) + sx * w, sy * h, static_cast<float>(z));
  mesh.normals.assign(4, {0, 0, -1});
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
  mesh.triangle_materials = {0, 0};
  mesh.materials[0].base_colour = k_colour_rgb;
  mesh.materials[0].unlit = true;
  return mesh;
}

// A plane of 0.6 x 0.4 m at z = 1 m, a projector and a camera at the origin, one part of the given mesh.
World plane_world(scene::Mode mode, const scene::Mesh& part) {
  World world;
  const Lens lens = Lens::pinhole(k_focal_px, k_focal_px, 159.5, 119.5);
  world.rig.projectors = {{"projector0", 320, 240, lens, Pose()}};
  world.rig.cameras = {{"camera0", 320, 240, lens, Pose()}};
  world.world_from_prototype = Pose(Eigen::Quaterniond::Identity(), {0, 0, 1});
  Object prototype;
  prototype.name = "prototype";
  prototype.mesh = std::make_shared<scene::Mesh>(sheet_at(0.6, 0.4, 0, 0));
  prototype.world_from_object = world.world_from_prototype;
  world.objects = {prototype};
  scene::Slot slot;
  slot.name = "part";
  slot.mode = mode;
  slot.variants = {{"a", part}};
  world.scene.emplace();
  world.scene->slots = {slot};
  return world;
}

scene::PosedScene posed(const World& world) {
  return {world.world_from_prototype, {{"part", "a", world.world_from_prototype}}};
}

Imager viewer_at(const Eigen::Vector3d& p_viewpoint) {
  return viewer_imager(looking_at(p_viewpoint, {0, 0, 1}, -Eigen::Vector3d::UnitY()).inverse(), 320, 240, 40);
}

// Centroid of the covered pixels and their number; pixels at edges count by their share.
std::pair<Eigen::Vector2d, double> centroid(const cv::Mat& cover) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (int row = 0; row < cover.rows; ++row)
    for (int column = 0; column < cover.cols; ++column)
      sum += cover.at<float>(row, column) * Eigen::Vector2d(column, row);
  const double area = cv::sum(cover)[0];
  return {sum / area, area};
}

TEST(ReferenceRenderer, LightOfAViewPartLiesWhereTheEyeSeesItOnThePlane) {
  // The part is 0.1 m in front of the plane, 0.08 x 0.06 m. Seen by a viewer at x = 0.5 and 1 m from the
  // plane, it covers a rectangle that is 1 / 0.9 times as large, shifted by 0.5 * (1 - 1 / 0.9).
  const World world = plane_world(scene::Mode::view, sheet_at(0.08, 0.06, 0.05, -0.1));
  const ReferenceRenderer reference(world, posed(world), viewer_at({0.5, 0, 0}));
  const PartImage image = reference.projector_image(0);
  const auto [centre, area] = centroid(image.cover);
  const double x_plane = 0.5 + (0.05 - 0.5) / 0.9;
  EXPECT_TRUE(test::near(centre, Eigen::Vector2d(159.5 + k_focal_px * x_plane, 119.5), 0.02));
  EXPECT_NEAR(area, 0.08 * 0.06 / 0.81 * k_focal_px * k_focal_px, 4);
  const auto& light = image.light.at<cv::Vec3f>(cvRound(centre.y()), cvRound(centre.x()));
  EXPECT_EQ(light, cv::Vec3f(k_colour_rgb.z(), k_colour_rgb.y(), k_colour_rgb.x()));
}

TEST(ReferenceRenderer, AViewPartBehindThePlaneGetsNoLightAndIsNotSeen) {
  const World world = plane_world(scene::Mode::view, sheet_at(0.08, 0.06, 0.05, 0.1));
  const ReferenceRenderer reference(world, posed(world), viewer_at({0.5, 0, 0}));
  EXPECT_EQ(cv::countNonZero(reference.projector_image(0).cover), 0);
  EXPECT_EQ(cv::countNonZero(reference.parts_image(world.rig.cameras[0]).cover), 0);
  const DepthOrder order = reference.depth_order(world.rig.cameras[0]);
  EXPECT_GT(cv::countNonZero(order.contested), 300);
  EXPECT_EQ(cv::countNonZero(order.front != -1), 0);
}

TEST(ReferenceRenderer, WhatThePrototypeHidesFromTheEyeGetsNoLight) {
  World world = plane_world(scene::Mode::view, sheet_at(0.08, 0.06, 0.05, -0.1));
  const Imager viewer = viewer_at({0.5, 0, 0});
  EXPECT_GT(cv::countNonZero(ReferenceRenderer(world, posed(world), viewer).projector_image(0).cover), 500);
  // A flap of the prototype half way to the viewer, outside the projector's image.
  scene::Mesh flapped = *world.objects[0].mesh;
  const scene::Mesh flap = sheet_at(0.12, 0.12, 0.35, -0.7);
  flapped.positions.insert(flapped.positions.end(), flap.positions.begin(), flap.positions.end());
  flapped.normals.insert(flapped.normals.end(), flap.normals.begin(), flap.normals.end());
  flapped.triangles.insert(flapped.triangles.end(), {{4, 6, 5}, {4, 7, 6}});
  flapped.triangle_materials.assign(4, 0);
  world.objects[0].mesh = std::make_shared<scene::Mesh>(flapped);
  EXPECT_EQ(cv::countNonZero(ReferenceRenderer(world, posed(world), viewer).projector_image(0).cover), 0);
}

TEST(ReferenceRenderer, SurfacePartsAreLitForEveryEyeWithinTwoMillimetresOnly) {
  for (const double z : {0.0, -0.0015, 0.0015, -0.003, 0.003}) {
    const World world = plane_world(scene::Mode::surface, sheet_at(0.08, 0.06, 0.05, z));
    for (const double x_viewer : {-0.5, 0.5}) {
      const ReferenceRenderer reference(world, posed(world), viewer_at({x_viewer, 0, 0}));
      const auto [centre, area] = centroid(reference.projector_image(0).cover);
      if (std::abs(z) > 0.002) {
        EXPECT_EQ(area, 0) << "height " << z;
      } else {
        EXPECT_TRUE(test::near(centre, Eigen::Vector2d(179.5, 119.5), 0.02)) << "height " << z;
        EXPECT_NEAR(area, 0.08 * 0.06 * k_focal_px * k_focal_px, 4) << "height " << z;
      }
    }
  }
}

TEST(ReferenceRenderer, SeenPartsCoverTheirEdgesInPart) {
  // The part covers columns 139.75 to 171.75.
  const World world =
      plane_world(scene::Mode::view, sheet_at(32 / 400.0 * 0.9, 24 / 400.0 * 0.9, -3.75 / 400.0 * 0.9, -0.1));
  const PartImage seen =
      ReferenceRenderer(world, posed(world), world.rig.cameras[0]).parts_image(world.rig.cameras[0]);
  EXPECT_NEAR(cv::sum(seen.cover)[0], 32 * 24, 0.5);
  EXPECT_NEAR(seen.cover.at<float>(119, 140), 0.75, 1e-6);
  EXPECT_NEAR(seen.cover.at<float>(119, 172), 0.25, 1e-6);
  EXPECT_NEAR(seen.light.at<cv::Vec3f>(119, 172)[0], 0.25F * k_colour_rgb.z(), 1e-6);
}

TEST(ReferenceRenderer, ShadingFollowsTheLampOverTheEyesLeftShoulder) {
  World world = plane_world(scene::Mode::view, sheet_at(0.2, 0.2, 0, -0.1));
  world.scene->slots[0].variants[0].mesh.materials[0] = {
      .base_colour = {1, 1, 1}, .unlit = false, .texture = {}};
  const Imager& camera = world.rig.cameras[0];
  const auto middle = [&](const Pose& turn) {
    scene::PosedScene turned = posed(world);
    turned.parts[0].world_from_part = world.world_from_prototype * turn;
    return ReferenceRenderer(world, turned, camera).parts_image(camera).light.at<cv::Vec3f>(119, 159)[0];
  };
  // Facing the viewer: soft light half way between 0.15 and 0.35, and the lamp's cosine 0.68 / |(.36, .64,
  // .68)|.
  EXPECT_NEAR(middle(Pose()), 0.25 + 0.65 * 0.68 / std::sqrt(0.36 * 0.36 + 0.64 * 0.64 + 0.68 * 0.68), 1e-4);
  const auto tilted = [&](double w) {
    return middle(Pose(exp_rotation({w, 0, 0}), Eigen::Vector3d::Zero()));
  };
  EXPECT_GT(tilted(-0.4), tilted(0.4) + 0.2) << "a surface that faces up must be brighter";
}

// A sheet that faces the viewer; its normal map is tilted half towards the texture's right and up.
scene::Mesh mapped_sheet() {
  scene::Mesh part = sheet_at(0.2, 0.2, 0, -0.1);
  for (const auto& p : part.positions) part.uvs.emplace_back(p.x() / 0.2F + 0.5F, 0.5F - p.y() / 0.2F);
  part.materials[0] = {.base_colour = {1, 1, 1}, .texture = {}};
  part.materials[0].maps.normals.image = cv::Mat(2, 2, CV_8UC3, cv::Scalar(255, 191, 191));
  scene::add_tangents(&part);
  return part;
}

TEST(ReferenceRenderer, NormalsOfAMapAreLitByTheScenesRoom) {
  const double aside = 2 * 191 / 255.0 - 1;
  const Eigen::Vector3d n = Eigen::Vector3d(aside, -aside, -1).normalized();  // up is -y
  for (const scene::Mode mode : {scene::Mode::view, scene::Mode::surface}) {
    World world = plane_world(mode, mapped_sheet());
    if (mode == scene::Mode::surface)
      for (auto& p : world.scene->slots[0].variants[0].mesh.positions) p.z() = -0.001F;
    world.scene->light.emplace();
    for (const Eigen::Vector3d& d_lamp :
         {Eigen::Vector3d(0.5, -0.1, -0.8), Eigen::Vector3d(-0.5, 0.1, -0.8)}) {
      world.scene->light->lamps = {{d_lamp.normalized(), {0.2, 0.3, 0.4}}};
      const double nl = n.dot(d_lamp.normalized());
      for (const PartImage& image :
           {ReferenceRenderer(world, posed(world), viewer_at({0.1, 0, 0})).projector_image(0),
            ReferenceRenderer(world, posed(world), viewer_at({0.1, 0, 0})).parts_image(world.rig.cameras[0])})
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(image.light.at<cv::Vec3f>(119, 159)[c], nl * (0.4 - 0.1 * c), 1e-4);
    }
  }
}

}  // namespace
}  // namespace limn::sim
