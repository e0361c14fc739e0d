// Compares the renderer's warp with one made on the CPU: a map from the projector's lens (mrcal), then
// cv::remap.
#include <Eigen/Dense>
#include <cmath>
#include <iostream>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/image_io.h"
#include "projector/renderer.h"
#include "tests/projector/gl_test.h"
#include "tests/support/matchers.h"
#include "tests/support/meshes.h"

namespace limn::projector {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_wall[2] = {0.5, 0.4}, k_part[2] = {0.3, 0.24};  // m, sides
constexpr int k_texture[2] = {250, 200};                           // texels
constexpr double k_stand_off = 0.05;                               // m, of the view part

// Linear light of the part at x, y (m, relative to its middle).
Vector3d pattern_rgb(double x, double y) {
  const double a = std::sin(2 * M_PI * x / 0.042), b = std::sin(2 * M_PI * y / 0.038);
  return {0.4 + 0.25 * a, 0.4 + 0.25 * b, 0.4 + 0.12 * (a + b)};
}

scene::Mesh sheet(const double (&sides)[2], double z) { return test::textured_sheet(sides[0], sides[1], z); }

// The pattern as an image: linear light, CV_32FC3 BGR.
cv::Mat pattern_image() {
  cv::Mat image(k_texture[1], k_texture[0], CV_32FC3);
  for (int row = 0; row < image.rows; ++row)
    for (int column = 0; column < image.cols; ++column) {
      const Vector3d rgb = pattern_rgb(((column + 0.5) / image.cols - 0.5) * k_part[0],
                                       ((row + 0.5) / image.rows - 0.5) * k_part[1]);
      image.at<cv::Vec3f>(row, column) = cv::Vec3d(rgb[2], rgb[1], rgb[0]);
    }
  return image;
}

scene::Scene wall_with(scene::Mode mode) {
  scene::Scene scene;
  scene.prototype = scene::Prototype{sheet(k_wall, 0), {}, 0.8, {}};
  scene::Slot slot;
  slot.name = "part";
  slot.mode = mode;
  slot.variants.push_back({"a", sheet(k_part, mode == scene::Mode::view ? -k_stand_off : -0.0005)});
  scene::Material& material = slot.variants[0].mesh.materials[0];
  material.base_colour = {1, 1, 1};
  material.unlit = true;
  const cv::Mat light = pattern_image();
  material.texture.create(light.size(), CV_8UC3);
  for (int row = 0; row < light.rows; ++row)
    for (int column = 0; column < light.cols; ++column)
      for (int c = 0; c < 3; ++c)
        material.texture.at<cv::Vec3b>(row, column)[c] = cv::saturate_cast<std::uint8_t>(
            255 * srgb_from_linear(static_cast<double>(light.at<cv::Vec3f>(row, column)[c])));
  scene.slots.push_back(slot);
  return scene;
}

// Where the ray hits the plane of this z.
Vector3d on_plane(const Vector3d& p, const Vector3d& d, double z) { return p + (z - p.z()) / d.z() * d; }

// First pass for a view part: its image from the viewer's position.
cv::Mat viewer_image(const Imager& viewer) {
  const Vector3d p_viewpoint = viewer.imager_from_world.inverse().translation;
  cv::Mat image(viewer.height, viewer.width, CV_32FC3);
  for (int row = 0; row < image.rows; ++row)
    for (int column = 0; column < image.cols; ++column) {
      const Vector3d p = on_plane(p_viewpoint, viewer.ray(Vector2d(column, row))->d, -k_stand_off);
      const Vector3d rgb = pattern_rgb(p.x(), p.y());
      image.at<cv::Vec3f>(row, column) = cv::Vec3d(rgb[2], rgb[1], rgb[0]);
    }
  return image;
}

// Second pass: the pixel of `source` that each pixel of the projector shows. `inside` is 255 where the part
// is.
struct Warp {
  cv::Mat map, inside;
};

Warp warp_of(const Imager& projector, const Imager& viewer, scene::Mode mode, const Vector2d& shift_px) {
  Warp warp{cv::Mat(projector.height, projector.width, CV_32FC2, cv::Scalar::all(-1e4)),
            cv::Mat::zeros(projector.height, projector.width, CV_8U)};
  const Vector3d p_viewpoint = viewer.imager_from_world.inverse().translation;
  for (int row = 0; row < projector.height; ++row)
    for (int column = 0; column < projector.width; ++column) {
      const auto ray = projector.ray(Vector2d(column, row) + shift_px);
      if (!ray) continue;
      const Vector3d p_wall = on_plane(ray->p_origin, ray->d, 0);
      const Vector3d p_part =
          mode == scene::Mode::view ? on_plane(p_viewpoint, p_wall - p_viewpoint, -k_stand_off) : p_wall;
      const Vector2d at(p_part.x() / k_part[0] + 0.5, p_part.y() / k_part[1] + 0.5);
      const bool on_wall = std::abs(p_wall.x()) < k_wall[0] / 2 && std::abs(p_wall.y()) < k_wall[1] / 2;
      if (!on_wall || at.minCoeff() < 0 || at.maxCoeff() > 1) continue;
      const Vector2d px = mode == scene::Mode::view
                              ? *viewer.project(p_wall)
                              : Vector2d(at.x() * k_texture[0] - 0.5, at.y() * k_texture[1] - 0.5);
      warp.map.at<cv::Vec2f>(row, column) = cv::Vec2d(px.x(), px.y());
      warp.inside.at<std::uint8_t>(row, column) = 255;
    }
  return warp;
}

// The projector's image by cv::remap: display values (gamma 2.2) before rounding.
cv::Mat remapped(const cv::Mat& source, const Warp& warp) {
  cv::Mat light, levels;
  cv::remap(source, light, warp.map, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_CONSTANT);
  cv::pow(cv::max(light, 0.0), 1 / 2.2, levels);
  return 255 * levels;
}

// The shift of `found` against `expected` (px) in each square of `side` pixels that lies inside: least
// squares over the gradients of all channels.
std::vector<Vector2d> shifts_px(const cv::Mat& found,
                                const cv::Mat& expected,
                                const cv::Mat& inside,
                                int side) {
  cv::Mat dx, dy;
  cv::Sobel(expected, dx, CV_32F, 1, 0, 3, 1.0 / 8);
  cv::Sobel(expected, dy, CV_32F, 0, 1, 3, 1.0 / 8);
  std::vector<Vector2d> shifts;
  for (int y = 0; y + side <= found.rows; y += side)
    for (int x = 0; x + side <= found.cols; x += side) {
      const cv::Rect square(x, y, side, side);
      if (cv::countNonZero(inside(square)) < side * side) continue;
      // unknowns: shift, and a constant difference in levels.
      Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
      Vector3d right = Vector3d::Zero();
      for (int row = y; row < y + side; ++row)
        for (int column = x; column < x + side; ++column)
          for (int c = 0; c < 3; ++c) {
            const Vector3d gradient(static_cast<double>(dx.at<cv::Vec3f>(row, column)[c]),
                                    static_cast<double>(dy.at<cv::Vec3f>(row, column)[c]), 1);
            normal += gradient * gradient.transpose();
            right -= gradient * static_cast<double>(found.at<cv::Vec3f>(row, column)[c] -
                                                    expected.at<cv::Vec3f>(row, column)[c]);
          }
      shifts.emplace_back(normal.ldlt().solve(right).head<2>());
    }
  return shifts;
}

double worst_of(const std::vector<Vector2d>& shifts) {
  double worst = 0;
  for (const Vector2d& shift : shifts) worst = std::max(worst, shift.norm());
  return worst;
}

using WarpTest = test::GlTest;

TEST_F(WarpTest, IsWhatRemapMakesOfTheLens) {
  const Pose pose = looking_at({-0.35, -0.1, -1.1}, {0, 0, 0}, {0, -1, 0});
  const Imager projectors[] = {
      {"projector0", 640, 400,
       Lens::create("LENSMODEL_OPENCV4", {1000, 1000, 325, 190, -0.15, 0.1, 0.002, -0.001}).value(), pose},
      {"projector0", 640, 400,
       Lens::create("LENSMODEL_OPENCV8",
                    {1000, 990, 300, 380, 0.12, -0.08, 0.001, 0.002, 0.02, 0.05, -0.02, 0.01})
           .value(),
       looking_at({0.1, 0.3, -1.1}, {0, 0.12, 0}, {0, -1, 0})}};
  const Imager viewer =
      viewer_imager(looking_at({0.2, -0.3, -1.2}, {0, 0, 0}, {0, -1, 0}).inverse(), 2400, 1800, 25);
  for (const scene::Mode mode : {scene::Mode::view, scene::Mode::surface}) {
    const cv::Mat source = mode == scene::Mode::view ? viewer_image(viewer) : pattern_image();
    const scene::Scene scene = wall_with(mode);
    const scene::PosedScene posed{Pose(), {{"part", "a", Pose()}}};
    for (const Imager& projector : projectors) {
      Rig rig;
      rig.projectors = {projector};
      auto made = Renderer::create(scene, rig);
      ASSERT_TRUE(made) << made.message();
      cv::Mat found;
      made->projector_image(0, posed, viewer).convertTo(found, CV_32F);
      const Warp warp = warp_of(projector, viewer, mode, {0, 0});
      const cv::Mat expected = remapped(source, warp);
      cv::Mat inside;
      cv::erode(warp.inside, inside, cv::getStructuringElement(cv::MORPH_RECT, {5, 5}), {-1, -1}, 1,
                cv::BORDER_CONSTANT, 0);
      ASSERT_GT(cv::countNonZero(inside), 30000);

      cv::Mat off;
      cv::absdiff(found, expected, off);
      const cv::Scalar mean = cv::mean(off, inside);
      cv::Mat flat;
      off.copyTo(flat, inside);
      const double over =
          static_cast<double>(cv::countNonZero(flat.reshape(1) > 2)) / (3.0 * cv::countNonZero(inside));
      const std::vector<Vector2d> shifts = shifts_px(found, expected, inside, 40);
      std::cout << (mode == scene::Mode::view ? "view" : "surface") << ", " << projector.lens.values.size()
                << " lens values"
                << ": mean " << mean[1] << " levels, " << 100 * over << " % over 2; worst shift of "
                << shifts.size() << " squares " << worst_of(shifts) << " px\n";
      EXPECT_LT(mean[1], 0.6);  // rounding of texture, image and positions (to 1/32 by cv::remap)
      EXPECT_LT(over, 1e-3);
      EXPECT_GT(shifts.size(), 15u);
      EXPECT_LT(worst_of(shifts), 0.05);
      // There is light where the part is, and elsewhere only at its outline.
      cv::Mat lit, wrong;
      cv::extractChannel(found, lit, 1);
      wrong = ((lit > 0) != (warp.inside > 0));
      cv::Mat outline;
      cv::morphologyEx(warp.inside, outline, cv::MORPH_GRADIENT,
                       cv::getStructuringElement(cv::MORPH_RECT, {3, 3}));
      EXPECT_EQ(cv::countNonZero(wrong & (outline == 0)), 0);

      // The measure must detect a shift of a tenth of a pixel.
      const cv::Mat shifted = remapped(source, warp_of(projector, viewer, mode, {0.1, 0}));
      for (const Vector2d& shift : shifts_px(found, shifted, inside, 40))
        EXPECT_LT((shift - Vector2d(0.1, 0)).norm(), 0.05);
    }
  }
}

}  // namespace
}  // namespace limn::projector
