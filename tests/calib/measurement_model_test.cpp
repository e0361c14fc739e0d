#include "calib/measurement_model.h"

#include <gtest/gtest.h>

#include <functional>

#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

struct Scene {
  Lens camera = Lens::create("LENSMODEL_OPENCV8",
                             {1400, 1405, 640, 500, -0.2, 0.1, 0.001, -0.002, 0.03, 0.1, 0.02, 0.01})
                    .value();
  Lens projector =
      Lens::create("LENSMODEL_OPENCV4", {1500, 1490, 640, 1280, -0.1, 0.05, 0.002, 0.001}).value();
  Pose camera_from_world{exp_rotation({0.1, -0.2, 0.05}), {0.02, -0.03, 0.04}};
  Pose projector_from_world{exp_rotation({-0.3, 0.15, -0.02}), {0.2, 0.1, 0.05}};
  Pose world_from_board{exp_rotation({0.3, -0.25, 0.2}), {-0.12, -0.1, 1.0}};
  Vector2d bend{0.004, -0.006};
  BoardShape shape{0.275, 0.2};
  Vector2d px_camera{600.3, 480.7};

  ImagerView camera_view() const { return {camera.model, camera.values, camera_from_world}; }
  ImagerView projector_view() const { return {projector.model, projector.values, projector_from_world}; }
  Vector2d match() const {
    Vector2d px;
    EXPECT_TRUE(
        predict_match(camera_view(), projector_view(), world_from_board, shape, bend, px_camera, &px));
    return px;
  }
  Vector2d corner() const {
    Vector2d px;
    EXPECT_TRUE(predict_corner(camera_view(), world_from_board, shape, bend, {0.1, 0.05}, &px));
    return px;
  }
};

// Central difference of `predict` when `change` moves one parameter by a step.
Vector2d slope(const std::function<void(Scene*, double)>& change,
               const std::function<Vector2d(const Scene&)>& predict,
               double step) {
  Scene up, down;
  change(&up, step);
  change(&down, -step);
  return (predict(up) - predict(down)) / (2 * step);
}

void expect_slope(const Vector2d& analytic, const Vector2d& numeric, const std::string& what) {
  EXPECT_LT((analytic - numeric).norm(), 2e-5 * (1 + numeric.norm()))
      << what << ": analytic " << analytic.transpose() << ", numeric " << numeric.transpose();
}

template <class Derivative>
void expect_pose(const Derivative& analytic,
                 Pose Scene::*pose,
                 const std::function<Vector2d(const Scene&)>& predict,
                 const std::string& what) {
  for (int i = 0; i < 6; ++i) {
    const auto numeric = slope(
        [&](Scene* s, double h) { s->*pose = boxplus(s->*pose, h * Vector6d::Unit(i)); }, predict, 1e-5);
    expect_slope(analytic.col(i), numeric, what + " " + std::to_string(i));
  }
}

void expect_values(const Derivatives::Values& analytic,
                   Lens Scene::*lens,
                   const std::function<Vector2d(const Scene&)>& predict,
                   const std::string& what) {
  for (int i = 0; i < analytic.cols(); ++i) {
    const double step = i < 4 ? 1e-2 : 1e-5;
    const auto numeric =
        slope([&](Scene* s, double h) { (s->*lens).values[static_cast<size_t>(i)] += h; }, predict, step);
    expect_slope(analytic.col(i), numeric, what + " " + std::to_string(i));
  }
}

TEST(Predict, DerivativesOfAMatchAreFiniteDifferences) {
  const Scene scene;
  const auto predict = [](const Scene& s) { return s.match(); };
  Derivatives d;
  Vector2d px;
  ASSERT_TRUE(predict_match(scene.camera_view(), scene.projector_view(), scene.world_from_board, scene.shape,
                            scene.bend, scene.px_camera, &px, &d));
  expect_values(d.camera_values, &Scene::camera, predict, "camera value");
  expect_values(d.projector_values, &Scene::projector, predict, "projector value");
  expect_pose(d.camera_pose, &Scene::camera_from_world, predict, "camera pose");
  expect_pose(d.projector_pose, &Scene::projector_from_world, predict, "projector pose");
  expect_pose(d.board_pose, &Scene::world_from_board, predict, "board pose");
  for (int i = 0; i < 2; ++i)
    expect_slope(d.bend.col(i), slope([&](Scene* s, double h) { s->bend[i] += h; }, predict, 1e-6), "bend");
}

TEST(Predict, DerivativesOfACornerAreFiniteDifferences) {
  const Scene scene;
  const auto predict = [](const Scene& s) { return s.corner(); };
  Derivatives d;
  Vector2d px;
  ASSERT_TRUE(predict_corner(scene.camera_view(), scene.world_from_board, scene.shape, scene.bend,
                             {0.1, 0.05}, &px, &d));
  expect_values(d.camera_values, &Scene::camera, predict, "camera value");
  expect_pose(d.camera_pose, &Scene::camera_from_world, predict, "camera pose");
  expect_pose(d.board_pose, &Scene::world_from_board, predict, "board pose");
  for (int i = 0; i < 2; ++i)
    expect_slope(d.bend.col(i), slope([&](Scene* s, double h) { s->bend[i] += h; }, predict, 1e-6), "bend");
}

TEST(Predict, AMatchLiesOnTheBentSheetAndOnTheCameraRay) {
  const Scene scene;
  Vector3d p_world;
  ASSERT_TRUE(intersect_board(scene.camera_view(), scene.world_from_board, scene.shape, scene.bend,
                              scene.px_camera, &p_world));
  const Vector3d p_board = scene.world_from_board.inverse() * p_world;
  EXPECT_NEAR(p_board.z(), scene.shape.z(scene.bend, p_board.x(), p_board.y()), 1e-12);
  const auto px = scene.camera.project(scene.camera_from_world * p_world);
  ASSERT_TRUE(px.has_value());
  EXPECT_TRUE(test::near(*px, scene.px_camera, 1e-6));
}

TEST(Predict, MovingTheWorldLeavesPixelsWhereTheyWere) {
  Scene scene;
  const Vector2d match = scene.match(), corner = scene.corner();
  const Pose other_from_world(exp_rotation({0.5, 1.0, -0.7}), Vector3d(1, 2, 3));
  scene.camera_from_world = scene.camera_from_world * other_from_world.inverse();
  scene.projector_from_world = scene.projector_from_world * other_from_world.inverse();
  scene.world_from_board = other_from_world * scene.world_from_board;
  EXPECT_TRUE(test::near(scene.match(), match, 1e-8));
  EXPECT_TRUE(test::near(scene.corner(), corner, 1e-8));
}

TEST(Predict, ABoardBehindTheCameraHasNoPixel) {
  Scene scene;
  scene.world_from_board.translation.z() = -1;
  Vector2d px;
  EXPECT_FALSE(
      predict_corner(scene.camera_view(), scene.world_from_board, scene.shape, scene.bend, {0.1, 0.05}, &px));
  EXPECT_FALSE(predict_match(scene.camera_view(), scene.projector_view(), scene.world_from_board, scene.shape,
                             scene.bend, scene.px_camera, &px));
}

}  // namespace
}  // namespace limn::calib
