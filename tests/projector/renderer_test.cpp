#include "projector/renderer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "core/image_io.h"
#include "core/photometric_response.h"
#include "projector/composite_policy.h"
#include "sim/ray_scene.h"
#include "tests/projector/sheet_room.h"
#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

TEST_F(RendererTest, SurfacePointsOfAPlaneAreOnTheExactRays) {
  const Scene scene = scene_of(sheet(0.5, 0.4), {});
  PosedScene posed = posed_at_origin(scene);
  posed.world_from_prototype = Pose(exp_rotation({0.2, -0.3, 0.1}), {0.02, 0.01, 0.05});
  const Rig rig = two_projectors();
  Renderer drawing = renderer(scene, rig);
  for (std::size_t i = 0; i < 2; ++i) {
    const cv::Mat points = drawing.surface_points(i, posed);
    ASSERT_EQ(points.type(), CV_32FC3);
    int seen = 0, disagreeing = 0;
    double worst_px = 0;
    for (int row = 0; row < points.rows; ++row) {
      for (int column = 0; column < points.cols; ++column) {
        const auto& p = points.at<cv::Vec3f>(row, column);
        const Ray world = *rig.projectors[i].ray(Vector2d(column, row));
        const Pose from_world = posed.world_from_prototype->inverse();
        const Ray ray{from_world * world.p_origin, from_world.rotation * world.d};
        const auto truth = on_sheet(ray, 0.5, 0.4, 0);
        if (std::isnan(p[0]) == truth.has_value()) {
          ++disagreeing;
          continue;
        }
        if (!truth) continue;
        ++seen;
        const auto px = rig.projectors[i].project(*posed.world_from_prototype * Vector3d(p[0], p[1], p[2]));
        worst_px = std::max(worst_px, (*px - Vector2d(column, row)).norm());
        EXPECT_NEAR((Vector3d(p[0], p[1], p[2]) - *truth).norm(), 0, 3e-5);
      }
    }
    EXPECT_GT(seen, 50000);
    EXPECT_LE(disagreeing, 8);  // pixel centres within 0.005 px of an outline of 1500 px
    EXPECT_LT(worst_px, 0.02);
  }
}

TEST_F(RendererTest, SurfacePointsOfADenseSphereReachItsSilhouette) {
  constexpr double k_radius = 0.15;
  // Near the poles the triangles are much smaller than a pixel, so that the ids miss most of them.
  const Scene scene =
      scene_of(grid(300, 300,
                    [](double u, double v) {
                      const double a = 2 * M_PI * u, b = M_PI * v;
                      return Vector3d(k_radius * std::sin(b) * std::cos(a), -k_radius * std::cos(b),
                                      k_radius * std::sin(b) * std::sin(a));
                    }),
               {});
  const Rig rig = two_projectors();
  const cv::Mat points = renderer(scene, rig).surface_points(0, posed_at_origin(scene));
  int seen = 0, disagreeing = 0;
  double worst = 0;
  for (int row = 0; row < points.rows; ++row) {
    for (int column = 0; column < points.cols; ++column) {
      const auto& found = points.at<cv::Vec3f>(row, column);
      const Ray ray = *rig.projectors[0].ray(Vector2d(column, row));
      const double along = -ray.p_origin.dot(ray.d);
      const double off_axis = (ray.p_origin + along * ray.d).norm();
      if (std::isnan(found[0]) == (off_axis < k_radius)) ++disagreeing;
      if (std::isnan(found[0])) continue;
      ++seen;
      // Grazing angles beyond 82 degrees, where texels see very thin triangles.
      if (off_axis > 0.99 * k_radius) continue;
      worst = std::max(worst, std::abs(Vector3d(found[0], found[1], found[2]).norm() - k_radius));
    }
  }
  EXPECT_GT(seen, 40000);
  EXPECT_LT(disagreeing, 150);  // 0.2 px along a silhouette of some 800 px
  EXPECT_LT(worst, 6e-5);       // chords of 300 segments lie 1 to 4e-5 m below the circle
}

TEST_F(RendererTest, ViewPartStandsWhereTheViewersEyeSeesIt) {
  // The part is 50 mm off the surface and overhangs its right edge.
  const Eigen::Vector3f colour(0.25f, 0.5f, 0.75f);
  const Scene scene = scene_of(
      sheet(0.5, 0.4), {slot("mirror", scene::Mode::view, coloured(sheet(0.16, 0.1, -0.05), colour))});
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].world_from_part.translation = {0.2, 0.02, 0};
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  for (const Vector3d& p_viewpoint : {Vector3d(-0.3, -0.3, -1.2), Vector3d(0.4, 0.1, -1.0)}) {
    const cv::Mat found = renderer(scene, rig).projector_image(0, posed, viewer_from(p_viewpoint));
    cv::Mat expected(found.size(), CV_64FC3), light(found.size(), CV_64FC3);
    for (int row = 0; row < found.rows; ++row) {
      for (int column = 0; column < found.cols; ++column) {
        const double cover = pixel_mean(column, row, [&](const Vector2d& px) {
          const auto p = on_sheet(*rig.projectors[0].ray(px), 0.5, 0.4, 0);
          if (!p) return 0;
          const Ray from_eye{p_viewpoint - Vector3d(0.2, 0.02, 0), (*p - p_viewpoint).normalized()};
          return on_sheet(from_eye, 0.16, 0.1, -0.05) ? 1 : 0;
        });
        for (int c = 0; c < 3; ++c) {
          expected.at<cv::Vec3d>(row, column)[c] = cover * static_cast<double>(colour[2 - c]);
          light.at<cv::Vec3d>(row, column)[c] = light_of(found.at<cv::Vec3b>(row, column)[c]);
        }
      }
    }
    EXPECT_GT(cv::sum(expected)[0], 3000);
    // One column of the sixteen samples may lie on the other side of an edge.
    EXPECT_TRUE(test::image_near(light, expected, 1e-4, 4.2 / 16, "light"));
  }
}

TEST_F(RendererTest, SurfacePartIsTheSameForEveryViewerAndOnlyWithinTwoMillimetres) {
  const auto part = [](double z) {
    return slot("trim", scene::Mode::surface, coloured(sheet(0.2, 0.03, z), {1, 1, 1}));
  };
  const Rig rig = two_projectors();
  for (const double z : {0.0, -0.0015, 0.0015, -0.003}) {
    const Scene scene = scene_of(sheet(0.5, 0.4), {part(z)});
    Renderer drawing = renderer(scene, rig);
    const PosedScene posed = posed_at_origin(scene);
    const cv::Mat a = drawing.projector_image(0, posed, viewer_from({-0.3, -0.3, -1.2}));
    const cv::Mat b = drawing.projector_image(0, posed, viewer_from({0.5, 0.1, -1.0}));
    EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0);
    const cv::Mat points = drawing.surface_points(0, posed);
    int lit = 0, wrong = 0;
    for (int row = 0; row < a.rows; ++row) {
      for (int column = 0; column < a.cols; ++column) {
        const auto& p = points.at<cv::Vec3f>(row, column);
        const bool is_lit = a.at<cv::Vec3b>(row, column)[1] > 0;
        lit += is_lit;
        const double beside = std::max(std::abs(p[0]) - 0.1f, std::abs(p[1]) - 0.015f);
        if (std::abs(beside) < 0.001) continue;  // the pixel lies on the outline
        wrong += is_lit != (beside < 0 && std::abs(z) <= 0.002);
      }
    }
    EXPECT_EQ(wrong, 0) << "height " << z;
    if (std::abs(z) <= 0.002) {
      EXPECT_GT(lit, 3000);
    } else {
      EXPECT_EQ(lit, 0);
    }
  }
}

TEST_F(RendererTest, PartBehindThePrototypeGetsNoLightAndIsCutInTheComposite) {
  const Scene scene = scene_of(
      sheet(0.3, 0.3), {slot("mirror", scene::Mode::view, coloured(sheet(0.2, 0.1, 0.05), {1, 0, 0}))});
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].world_from_part.translation = {0.15, 0, 0};
  const Rig rig = two_projectors();
  Renderer drawing = renderer(scene, rig);
  EXPECT_EQ(cv::countNonZero(drawing.projector_image(0, posed, rig.cameras[0]).reshape(1)), 0);
  const cv::Mat image(480, 640, CV_8UC3, cv::Scalar(10, 20, 30));
  const cv::Mat full = drawing.composite(0, image, posed, Composite::full);
  int drawn = 0, wrong = 0;
  for (int row = 0; row < full.rows; ++row) {
    for (int column = 0; column < full.cols; ++column) {
      const bool is_drawn = full.at<cv::Vec3b>(row, column)[2] > 187;  // more than half of its light
      drawn += is_drawn;
      Ray ray = *rig.cameras[0].ray(Vector2d(column, row));
      const bool hidden = on_sheet(ray, 0.3, 0.3, 0).has_value();
      ray.p_origin -= Vector3d(0.15, 0, 0);
      wrong += is_drawn != (!hidden && on_sheet(ray, 0.2, 0.1, 0.05).has_value());
    }
  }
  EXPECT_GT(drawn, 2000);
  EXPECT_LT(wrong, 40);  // half-covered pixels on an outline of some 400 pixels
}

TEST_F(RendererTest, CoverageSplitsAPartWhereTheSurfaceEnds) {
  const Scene scene = scene_of(sheet(0.3, 0.3), {slot("mirror", scene::Mode::view, sheet(0.2, 0.1, -0.05)),
                                                 slot("away", scene::Mode::view, sheet(0.05, 0.05, 0.05))});
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].world_from_part.translation = {0.12, 0.03, 0};
  const Rig rig = two_projectors();
  const Imager viewer = viewer_from({-0.2, -0.2, -1.3});
  const auto coverage = renderer(scene, rig).coverage(posed, viewer);
  ASSERT_EQ(coverage.size(), 2u);
  EXPECT_EQ(coverage[1].viewer_pixels, 0);  // behind the prototype
  int on = 0, off = 0, wrong = 0;
  for (int row = 0; row < viewer.height; ++row) {
    for (int column = 0; column < viewer.width; ++column) {
      Ray ray = *viewer.ray(Vector2d(column, row));
      const auto behind = on_sheet(ray, 0.3, 0.3, 0);
      ray.p_origin -= Vector3d(0.12, 0.03, 0);
      int expected = 0;
      if (on_sheet(ray, 0.2, 0.1, -0.05)) {
        const bool reached =
            behind && std::any_of(rig.projectors.begin(), rig.projectors.end(), [&](const Imager& p) {
              const auto px = p.project(*behind);
              return px && p.contains(*px);
            });
        expected = reached ? 255 : 128;
      }
      on += expected == 255;
      off += expected == 128;
      wrong += coverage[0].mask.at<std::uint8_t>(row, column) != expected;
    }
  }
  EXPECT_GT(on, 2000);
  EXPECT_GT(off, 1000);
  EXPECT_LT(wrong, 10);
  EXPECT_NEAR(coverage[0].on_surface_share, 1.0 * on / (on + off), 0.001);
  EXPECT_NEAR(coverage[0].on_surface_share + coverage[0].off_surface_share, 1, 1e-12);
}

TEST_F(RendererTest, CompositeDrawsPartsThroughTheCamerasLens) {
  const Scene scene = scene_of(
      sheet(0.3, 0.3), {slot("mirror", scene::Mode::view, coloured(sheet(0.25, 0.2, -0.05), {1, 1, 1}))});
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].world_from_part = Pose(exp_rotation({0.3, 0.4, 0.5}), {0.15, 0.05, 0});
  const Rig rig = two_projectors();
  Renderer drawing = renderer(scene, rig);
  const cv::Mat image = cv::Mat::zeros(480, 640, CV_8UC1);
  const cv::Mat full = drawing.composite(0, image, posed, Composite::full);
  const cv::Mat rest = drawing.composite(0, image, posed, Composite::rest);
  const Pose part_from_world = posed.parts[0].world_from_part.inverse();
  cv::Mat expected(480, 640, CV_64F), found(480, 640, CV_64F);
  int wrong_rest = 0, rest_pixels = 0;
  for (int row = 0; row < 480; ++row) {
    for (int column = 0; column < 640; ++column) {
      const auto seen = [&](const Vector2d& px) {
        const Ray ray = *rig.cameras[0].ray(px);
        const Ray in_part{part_from_world * ray.p_origin, part_from_world.rotation * ray.d};
        const auto p = on_sheet(in_part, 0.25, 0.2, -0.05);
        const auto behind = on_sheet(ray, 0.3, 0.3, 0);
        if (!p || (behind && (*p - in_part.p_origin).norm() > (*behind - ray.p_origin).norm())) return 0.0;
        return 1.0;
      };
      const double value = full.at<cv::Vec3b>(row, column)[0] / 255.0;
      found.at<double>(row, column) =
          value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
      expected.at<double>(row, column) = pixel_mean(column, row, seen);
      const bool is_drawn = rest.at<cv::Vec3b>(row, column)[0] > 187;  // more than half of its light
      rest_pixels += is_drawn;
      // Whether the sheet behind ends there, or `beside_px` pixels away.
      const auto is_off = [&](int beside_px) {
        return !on_sheet(*rig.cameras[0].ray(Vector2d(column, row)), 0.3 + 0.003 * beside_px,
                         0.3 + 0.003 * beside_px, 0);
      };
      const bool is_seen = seen(Vector2d(column, row)) > 0;
      const bool over_light = is_drawn && is_off(-2) && is_seen;  // within 2 px of what light cannot show
      wrong_rest += is_drawn != (is_off(0) && is_seen) && !over_light;
    }
  }
  EXPECT_GT(cv::sum(expected)[0], 20000);
  EXPECT_TRUE(test::image_near(found, expected, 1e-4, 3.2 / 8, "composite"));
  EXPECT_GT(rest_pixels, 3000);
  EXPECT_LT(wrong_rest, 80);  // half-covered pixels on an outline of some 1000 pixels
}

TEST_F(RendererTest, EachPartOfACompositeIsTreatedInItsOwnWay) {
  const Scene scene = scene_of(
      sheet(0.5, 0.4), {slot("left", scene::Mode::view, coloured(sheet(0.1, 0.1, -0.01), {0, 1, 0})),
                        slot("right", scene::Mode::view, coloured(sheet(0.1, 0.1, -0.01), {1, 0, 0}))});
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].world_from_part.translation.x() = -0.1;
  posed.parts[1].world_from_part.translation.x() = 0.1;
  Renderer drawing = renderer(scene, two_projectors());
  const cv::Mat image(480, 640, CV_8UC3, cv::Scalar::all(90));
  const cv::Mat full = drawing.composite(0, image, posed, Composite::full);
  const cv::Mat rest = drawing.composite(0, image, posed, Composite::rest);
  const cv::Rect left(0, 0, 320, 480), right(320, 0, 320, 480);
  ASSERT_GT(cv::norm(full(left), rest(left), cv::NORM_INF), 30);
  ASSERT_GT(cv::norm(full(right), rest(right), cv::NORM_INF), 30);
  for (const bool left_whole : {true, false, true}) {
    const std::vector<CompositePolicy> policies = {
        {"left", left_whole ? Composite::full : Composite::rest, 0},
        {"right", left_whole ? Composite::rest : Composite::full, 0}};
    const cv::Mat out = drawing.composite(0, image, posed, policies);
    EXPECT_EQ(cv::norm(out(left), (left_whole ? full : rest)(left), cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(out(right), (left_whole ? rest : full)(right), cv::NORM_INF), 0);
  }
}

TEST_F(RendererTest, BetweenRestAndFullACompositeIsTheirMixInLinearLight) {
  const Scene scene =
      scene_of(sheet(0.5, 0.4),
               {slot("mirror", scene::Mode::view, coloured(sheet(0.1, 0.1, -0.01), {0.2F, 0.9F, 0.6F}))});
  const PosedScene posed = posed_at_origin(scene);
  Renderer drawing = renderer(scene, two_projectors());
  const cv::Mat image(480, 640, CV_8UC3, cv::Scalar(200, 90, 30));
  const auto drawn = [&](double passing) {
    return drawing.composite(0, image, posed,
                             std::vector<CompositePolicy>{{"mirror", Composite::full, 0, passing}});
  };
  const cv::Mat full = drawn(0), rest = drawn(1);
  EXPECT_EQ(cv::norm(rest, drawing.composite(0, image, posed, Composite::rest), cv::NORM_INF), 0);
  ASSERT_GT(cv::norm(full, rest, cv::NORM_INF), 100);
  for (const double passing : {0.25, 0.6}) {
    cv::Mat expected(image.size(), CV_8UC3);
    for (int i = 0; i < static_cast<int>(image.total()) * 3; ++i) {
      const double light = (1 - passing) * linear_from_srgb(full.data[i] / 255.0) +
                           passing * linear_from_srgb(rest.data[i] / 255.0);
      expected.data[i] = cv::saturate_cast<std::uint8_t>(255 * srgb_from_linear(light));
    }
    EXPECT_LE(cv::norm(drawn(passing), expected, cv::NORM_INF), 3) << passing;
  }
}

TEST_F(RendererTest, WhereNoPartIsTheCompositeIsTheCamerasImage) {
  const Scene scene = scene_of(sheet(0.3, 0.3), {});
  auto rng = test::test_rng();
  cv::Mat image(480, 640, CV_8UC3);
  std::generate(image.begin<cv::Vec3b>(), image.end<cv::Vec3b>(), [&] {
    const auto v = rng();
    return cv::Vec3b(static_cast<std::uint8_t>(v), static_cast<std::uint8_t>(v >> 8),
                     static_cast<std::uint8_t>(v >> 16));
  });
  const cv::Mat out =
      renderer(scene, two_projectors()).composite(0, image, posed_at_origin(scene), Composite::full);
  EXPECT_EQ(cv::norm(out, image, cv::NORM_INF), 0);
}

TEST_F(RendererTest, LightOfTwoProjectorsSumsToThePartsColour) {
  // A grey sheet over everything that both projectors reach; 0.5, so that both clipping and rounding would be
  // visible.
  const Scene scene = scene_of(
      sheet(0.9, 0.7), {slot("paint", scene::Mode::surface, coloured(sheet(0.9, 0.7), {0.5f, 0.5f, 0.5f}))});
  const PosedScene posed = posed_at_origin(scene);
  const Rig rig = two_projectors();
  Renderer drawing = renderer(scene, rig);
  const Imager viewer = viewer_from({0, 0, -1.3});
  cv::Mat light[2];
  for (std::size_t i = 0; i < 2; ++i) {
    const cv::Mat image = drawing.projector_image(i, posed, viewer);
    light[i] = cv::Mat(image.size(), CV_32F);
    for (int row = 0; row < image.rows; ++row) {
      for (int column = 0; column < image.cols; ++column) {
        light[i].at<float>(row, column) = static_cast<float>(light_of(image.at<cv::Vec3b>(row, column)[1]));
      }
    }
  }
  const cv::Mat points = drawing.surface_points(0, posed);
  double worst = 0, worst_step = 0;
  int both = 0, alone = 0;
  for (int row = 1; row + 1 < points.rows; ++row) {
    double before = -1;
    for (int column = 1; column + 1 < points.cols; ++column) {
      const auto& p = points.at<cv::Vec3f>(row, column);
      if (!(std::abs(p[0]) < 0.445f && std::abs(p[1]) < 0.345f)) continue;  // not at the sheet's edge
      const Vector2d px = *rig.projectors[1].project(Vector3d(p[0], p[1], p[2]));
      double other = 0;
      const auto border = [](const Vector2d& q) {
        return std::min({q.x(), q.y(), 639 - q.x(), 399 - q.y()});
      };
      // Where two borders cross, the shares change from 0 to 1 around one point.
      if (std::max(border(px), border(Vector2d(column, row))) < 8) continue;
      if (rig.projectors[1].contains(px)) {
        const cv::Mat map(1, 1, CV_32FC2, cv::Scalar(px.x(), px.y()));
        cv::Mat value;
        cv::remap(light[1], value, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
        other = static_cast<double>(value.at<float>(0));
      }
      const double sum = static_cast<double>(light[0].at<float>(row, column)) + other;
      worst = std::max(worst, std::abs(sum / 0.5 - 1));
      if (before >= 0) worst_step = std::max(worst_step, std::abs(sum - before) / 0.5);
      before = sum;
      ++(other > 0 ? both : alone);
    }
  }
  EXPECT_GT(both, 50000);
  EXPECT_GT(alone, 5000);
  EXPECT_LT(worst, 0.02);       // twice the 8-bit rounding, which is 1.3 % at half light
  EXPECT_LT(worst_step, 0.02);  // the limit for seams in the docs: 2 % in linear light
}

TEST_F(RendererTest, BlendSharesTheLightAndMakesUpForMissingBlack) {
  const Scene scene = scene_of(sheet(1.1, 0.7), {});
  const PosedScene posed = posed_at_origin(scene);
  // The projectors stand side by side, so that a point's pixels in the two images are 320 pixels apart.
  constexpr int k_shift = 320;
  const double black[2] = {0.004, 0.01};
  const Vector3d p_viewpoint[2] = {{-0.2, 0, -1}, {0.2, 0, -1}};
  Rig rig;
  for (std::size_t i = 0; i < 2; ++i) {
    const Pose projector_from_world(Eigen::Quaterniond::Identity(), -p_viewpoint[i]);
    rig.projectors.push_back({i == 0 ? "projector0" : "projector1", 640, 400,
                              Lens::pinhole(800, 800, 320, 200), projector_from_world});
    rig.responses.push_back({rig.projectors[i].name, {0, 1}, {0, 1}, {0, 1}});
    rig.responses.back().black_level = Measurement{black[i], 0};
  }
  Renderer drawing = renderer(scene, rig);
  const cv::Mat blend[2] = {drawing.blend(0, posed), drawing.blend(1, posed)};
  const cv::Mat points = drawing.surface_points(0, posed);
  const auto irradiance = [&](std::size_t i, const Vector3d& p) {
    return 1 / std::pow((p_viewpoint[i] - p).norm(), 3);
  };
  double worst = 0, worst_lift = 0;
  int both = 0, alone = 0, nowhere = 0;
  for (int row = 0; row < points.rows; ++row) {
    for (int column = 0; column < points.cols; ++column) {
      const auto& q = points.at<cv::Vec3f>(row, column);
      const auto& own = blend[0].at<cv::Vec2f>(row, column);
      if (std::isnan(q[0])) {
        ++nowhere;
        EXPECT_EQ(own, cv::Vec2f(0, 0));
      } else if (column >= k_shift) {
        ++both;
        const auto& other = blend[1].at<cv::Vec2f>(row, column - k_shift);
        worst = std::max(worst, std::abs(own[0] + other[0] - 1.0));
        EXPECT_EQ(own[1], 0);
      } else {
        ++alone;
        const Vector3d p(q[0], q[1], q[2]);
        worst = std::max(worst, std::abs(own[0] - 1.0));
        worst_lift =
            std::max(worst_lift, std::abs(own[1] / (black[1] * irradiance(1, p) / irradiance(0, p)) - 1));
      }
    }
  }
  EXPECT_GT(both, 100000);
  EXPECT_GT(alone, 100000);
  EXPECT_GT(nowhere, 5000);
  EXPECT_LT(worst, 1e-3);  // equals a hundredth of a pixel in the soft border
  EXPECT_LT(worst_lift, 1e-4);
}

// Two projectors that differ only in their focus distance: the light is shared by how finely each can draw.
TEST_F(RendererTest, AProjectorOutOfFocusGivesLessOfTheLight) {
  const Scene scene = scene_of(sheet(1.1, 0.7), {});
  const PosedScene posed = posed_at_origin(scene);
  constexpr double k_focal = 800, k_aperture = 0.03;
  Rig rig;
  for (const char* name : {"projector0", "projector1"})
    rig.projectors.push_back({name, 640, 400, Lens::pinhole(k_focal, k_focal, 320, 200),
                              looking_at({0, -0.4, -1}, {0, 0, 0}, k_up)});
  const cv::Mat even = renderer(scene, rig).blend(0, posed);
  rig.focuses = {{"projector0", 1.0, k_aperture}, {"projector1", 1.15, k_aperture}};
  Renderer drawing = renderer(scene, rig);
  const cv::Mat blend = drawing.blend(0, posed), points = drawing.surface_points(0, posed);
  double least = 1, most = 0;
  int off = 0, lit = 0;
  for (int row = 0; row < blend.rows; ++row) {
    for (int column = 0; column < blend.cols; ++column) {
      const auto& q = points.at<cv::Vec3f>(row, column);
      if (std::isnan(q[0])) continue;
      const double depth = (rig.projectors[0].imager_from_world * Vector3d(q[0], q[1], q[2])).z();
      double fineness[2];
      for (std::size_t i = 0; i < 2; ++i) {
        const double disc = k_focal * k_aperture * std::abs(1 / rig.focuses[i].distance_m - 1 / depth);
        fineness[i] = 1 / (1.0 / 12 + disc * disc / 16);  // pixels are squares, blurred by discs
      }
      const double share = static_cast<double>(blend.at<cv::Vec2f>(row, column)[0]);
      ++lit;
      off += std::abs(share - fineness[0] / (fineness[0] + fineness[1])) > 1e-5;
      least = std::min(least, share);
      most = std::max(most, share);
      EXPECT_NEAR(even.at<cv::Vec2f>(row, column)[0], 0.5, 1e-6);
    }
  }
  EXPECT_GT(lit, 200000);
  EXPECT_LT(off, 20);  // rays between two triangles
  EXPECT_LT(least, 0.35);
  EXPECT_GT(most, 0.65);
}

TEST_F(RendererTest, ProjectorInTheOthersShadowGivesAllTheLight) {
  // A post in front of the plate keeps the right projector's light from a strip of the plate.
  Mesh mesh = sheet(0.5, 0.4);
  const Mesh post = sheet(0.04, 0.4, -0.15);
  const auto offset = static_cast<std::uint32_t>(mesh.positions.size());
  for (const auto& p : post.positions) mesh.positions.push_back(p);
  for (const auto& n : post.normals) mesh.normals.push_back(n);
  for (auto t : post.triangles) {
    for (auto& i : t) i += offset;
    mesh.triangles.push_back(t);
    mesh.triangle_materials.push_back(0);
  }
  const Scene scene =
      scene_of(mesh, {slot("paint", scene::Mode::surface, coloured(sheet(0.5, 0.4), {1, 1, 1}))});
  const PosedScene posed = posed_at_origin(scene);
  const Rig rig = two_projectors();
  Renderer drawing = renderer(scene, rig);
  const cv::Mat left = drawing.projector_image(0, posed, viewer_from({0, 0, -1.3}));
  const cv::Mat points = drawing.surface_points(0, posed);
  const Vector3d p_right = rig.projectors[1].imager_from_world.inverse().translation;
  int shadowed = 0, dim = 0;
  for (int row = 0; row < left.rows; ++row) {
    for (int column = 0; column < left.cols; ++column) {
      const auto& p = points.at<cv::Vec3f>(row, column);
      if (std::isnan(p[0]) || p[2] < -0.01f) continue;
      const Vector3d p_surface(p[0], p[1], p[2]);
      const Ray to_right{p_right, (p_surface - p_right).normalized()};
      const auto px = rig.projectors[1].project(p_surface);
      const double soft = std::min({px->x(), px->y(), 639 - px->x(), 399 - px->y()});
      // Only points at least a millimetre away from the shadow's outline and inside the plate.
      if (std::abs(p[0]) > 0.245f || std::abs(p[1]) > 0.195f || soft < 60) continue;
      if (on_sheet(to_right, 0.036, 0.396, -0.15)) {
        ++shadowed;
        EXPECT_EQ(left.at<cv::Vec3b>(row, column)[1], 255) << row << " " << column;
      } else if (!on_sheet(to_right, 0.044, 0.404, -0.15)) {
        dim += left.at<cv::Vec3b>(row, column)[1] < 255;
      }
    }
  }
  EXPECT_GT(shadowed, 500);
  EXPECT_GT(dim, 10000);
}

// The last triangles of a ball before its outline are seen at such a grazing angle that no id texel contains
// them.
TEST_F(RendererTest, ABallsShadowReachesAsFarAsItsOutline) {
  const Vector3d p_ball(0, 0, -0.12);
  constexpr double k_radius = 0.05;
  constexpr double k_pi = 3.14159265358979;
  const Mesh ball = grid(90, 45, [&](double u, double v) {
    const double a = 2 * k_pi * u, b = k_pi * v;
    return Vector3d(p_ball +
                    k_radius * Vector3d(std::sin(b) * std::cos(a), -std::cos(b), std::sin(b) * std::sin(a)));
  });
  Mesh mesh = sheet(0.5, 0.4);
  const auto offset = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), ball.positions.begin(), ball.positions.end());
  mesh.normals.insert(mesh.normals.end(), ball.normals.begin(), ball.normals.end());
  for (auto triangle : ball.triangles) {
    for (auto& i : triangle) i += offset;
    mesh.triangles.push_back(triangle);
    mesh.triangle_materials.push_back(0);
  }
  const Scene scene = scene_of(mesh, {});
  Rig rig = two_projectors();
  for (const Imager& projector : rig.projectors) {
    ProjectorResponse response;
    response.projector = projector.name;
    response.black_level = Measurement{0.004, 0};
    for (int value = 0; value < 256; ++value)
      response.green.push_back(0.004 + 0.996 * std::pow(value / 255.0, 2.2));
    response.red = response.blue = response.green;
    rig.responses.push_back(response);
  }
  Renderer drawing = renderer(scene, rig);
  const cv::Mat blend = drawing.blend(0, posed_at_origin(scene));
  const cv::Mat points = drawing.surface_points(0, posed_at_origin(scene));
  const sim::MeshInstance placed{&mesh, Pose()};
  const sim::RayScene truth(std::span(&placed, 1));
  const Vector3d p_right = rig.projectors[1].imager_from_world.inverse().translation;
  int shadowed = 0, lit_in_shadow = 0, dark_in_light = 0;
  for (int row = 0; row < points.rows; ++row) {
    for (int column = 0; column < points.cols; ++column) {
      const auto& p = points.at<cv::Vec3f>(row, column);
      if (std::isnan(p[0]) || p[2] < -0.001F) continue;
      const auto px = rig.projectors[1].project(Vector3d(p[0], p[1], p[2]));
      if (!px || !rig.projectors[1].contains(*px)) continue;
      const bool in_shadow = !truth.reached(p_right, Vector3d(p[0], p[1], p[2]));
      // Replaces the right projector's black level.
      const bool made_up = blend.at<cv::Vec2f>(row, column)[1] > 0;
      shadowed += in_shadow;
      lit_in_shadow += in_shadow && !made_up;
      dark_in_light += !in_shadow && made_up;
    }
  }
  EXPECT_GT(shadowed, 2000);
  EXPECT_LT(lit_in_shadow, 10);
  EXPECT_LT(dark_in_light, 10);
}

TEST_F(RendererTest, UnlitColourIsExactAndTheResponseIsApplied) {
  const Eigen::Vector3f colour(0.2f, 0.5f, 0.9f);
  const Scene scene =
      scene_of(sheet(0.5, 0.4), {slot("paint", scene::Mode::view, coloured(sheet(0.2, 0.2, -0.02), colour))});
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  const Imager viewer = viewer_from({0, 0, -1.3});
  const Vector2d middle = *rig.projectors[0].project({0, 0, 0});
  const auto at_middle = [&](const Rig& used) {
    const cv::Mat image = renderer(scene, used).projector_image(0, posed_at_origin(scene), viewer);
    EXPECT_EQ(image.at<cv::Vec3b>(2, 2), cv::Vec3b(0, 0, 0));
    return image.at<cv::Vec3b>(static_cast<int>(middle.y()), static_cast<int>(middle.x()));
  };
  const cv::Vec3b gamma = at_middle(rig);
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(gamma[2 - c], std::lround(255 * std::pow(static_cast<double>(colour[c]), 1 / 2.2)));
  }
  ProjectorResponse response{"projector0", {}, {}, {}};
  for (int i = 0; i <= 255; ++i) {
    response.red.push_back(std::pow(i / 255.0, 1.8));
    response.green.push_back(i / 255.0);
    response.blue.push_back(std::pow(i / 255.0, 2.6));
  }
  rig.responses = {response};
  const cv::Vec3b measured = at_middle(rig);
  EXPECT_EQ(measured[2], std::lround(255 * std::pow(0.2, 1 / 1.8)));
  EXPECT_EQ(measured[1], std::lround(255 * 0.5));
  EXPECT_EQ(measured[0], std::lround(255 * std::pow(0.9, 1 / 2.6)));
}

TEST_F(RendererTest, NothingIsDrawnAgainUntilSomethingChanges) {
  const Scene scene =
      scene_of(sheet(0.8, 0.6),
               {slot("panel", scene::Mode::view, coloured(sheet(0.3, 0.2, -0.05), {0.5f, 0.4f, 0.3f}))});
  Renderer drawn = renderer(scene, two_projectors());
  drawn.time_passes(true);
  PosedScene posed = posed_at_origin(scene);
  const Imager viewer = viewer_from({0.1, -0.2, -1.4});
  const cv::Mat first = drawn.projector_image(0, posed, viewer);
  EXPECT_GT(cv::countNonZero(first.reshape(1)), 1000);
  EXPECT_FALSE(drawn.pass_times().empty());
  const cv::Mat again = drawn.projector_image(0, posed, viewer);
  EXPECT_TRUE(drawn.pass_times().empty());
  EXPECT_EQ(cv::norm(first, again, cv::NORM_INF), 0);
  posed.parts[0].world_from_part.translation.x() += 0.01;
  EXPECT_GT(cv::norm(first, drawn.projector_image(0, posed, viewer), cv::NORM_INF), 10);
  EXPECT_FALSE(drawn.pass_times().empty());
  const cv::Mat from_there = drawn.projector_image(0, posed, viewer_from({-0.1, -0.2, -1.4}));
  EXPECT_GT(cv::norm(from_there, drawn.projector_image(0, posed, viewer), cv::NORM_INF), 10);
  // With another image behind them, the parts are not drawn again.
  const cv::Mat dark = cv::Mat::zeros(480, 640, CV_8UC1), bright(480, 640, CV_8UC1, cv::Scalar(200));
  const cv::Mat over_dark = drawn.composite(0, dark, posed, Composite::full);
  (void)drawn.pass_times();
  const cv::Mat over_bright = drawn.composite(0, bright, posed, Composite::full);
  EXPECT_EQ(drawn.pass_times().size(), 1u);
  EXPECT_EQ(over_bright.at<cv::Vec3b>(2, 2), cv::Vec3b(200, 200, 200));
  EXPECT_EQ(over_bright.at<cv::Vec3b>(240, 320), over_dark.at<cv::Vec3b>(240, 320));
  EXPECT_NE(over_dark.at<cv::Vec3b>(240, 320), cv::Vec3b(0, 0, 0));
  posed.parts[0].world_from_part.translation.x() += 0.05;
  EXPECT_GT(cv::norm(over_dark, drawn.composite(0, dark, posed, Composite::full), cv::NORM_INF), 10);
  EXPECT_GT(cv::norm(over_dark, drawn.composite(0, dark, posed, Composite::rest), cv::NORM_INF), 10);

  const cv::Mat plain = drawn.projector_image(0, posed, viewer);
  ASSERT_TRUE(drawn.set_light({.compensation = Compensation::geometry}));
  EXPECT_GT(cv::norm(plain, drawn.projector_image(0, posed, viewer), cv::NORM_INF), 5);
}

// No cache may change an image.
TEST_F(RendererTest, AnImageAfterOthersIsTheSameAsTheFirstOfItsKind) {
  const Scene scene =
      scene_of(sheet(0.5, 0.4),
               {slot("mirror", scene::Mode::view, coloured(sheet(0.16, 0.1, -0.05), {0.25f, 0.5f, 0.75f})),
                slot("trim", scene::Mode::surface, coloured(sheet(0.4, 0.03), {0.9f, 0.8f, 0.1f}))});
  const PosedScene still = posed_at_origin(scene);
  PosedScene part_moved = still, all_moved = still;
  part_moved.parts[0].world_from_part.translation.x() = 0.03;
  all_moved.parts[1].world_from_part.translation.y() = 0.05;
  all_moved.world_from_prototype->rotation = exp_rotation({0.2, 0.1, 0});
  for (auto& part : all_moved.parts)
    part.world_from_part = *all_moved.world_from_prototype * part.world_from_part;
  cv::Mat shadow(8, 8, CV_32F, cv::Scalar(1));
  shadow(cv::Rect(2, 2, 4, 4)).setTo(0);
  const Imager viewer = viewer_from({0.1, -0.1, -1.3});
  Renderer drawing = renderer(scene, two_projectors()), anew = renderer(scene, two_projectors()),
           anew_in_shadow = renderer(scene, two_projectors());
  anew_in_shadow.set_occlusion(1, shadow);
  (void)drawing.projector_image(0, still, viewer);
  EXPECT_EQ(cv::norm(drawing.projector_image(0, part_moved, viewer),
                     renderer(scene, two_projectors()).projector_image(0, part_moved, viewer), cv::NORM_INF),
            0);
  EXPECT_EQ(cv::norm(drawing.projector_image(0, all_moved, viewer),
                     anew.projector_image(0, all_moved, viewer), cv::NORM_INF),
            0);
  drawing.set_occlusion(1, shadow);
  const cv::Mat refilled = drawing.projector_image(0, all_moved, viewer);
  EXPECT_EQ(cv::norm(refilled, anew_in_shadow.projector_image(0, all_moved, viewer), cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(refilled, anew.projector_image(0, all_moved, viewer), cv::NORM_INF), 20);
}

TEST_F(RendererTest, WhatMovesIsDrawnQuicklyAndWholeOnceItStandsStill) {
  const Scene scene =
      scene_of(sheet(0.8, 0.6),
               {slot("panel", scene::Mode::view, coloured(sheet(0.3, 0.2, -0.05), {0.5f, 0.4f, 0.3f}))});
  const PosedScene posed = posed_at_origin(scene);
  PosedScene moved = posed;
  moved.parts[0].world_from_part = Pose(exp_rotation({0, 0, 0.1}), {0.011, 0.007, 0});
  const Imager viewer = viewer_from({0.1, -0.2, -1.4});
  const cv::Mat whole = renderer(scene, two_projectors()).projector_image(0, moved, viewer);

  Renderer drawn = renderer(scene, two_projectors());
  (void)drawn.projector_image(0, posed, viewer);
  drawn.set_quick_motion(true);
  const cv::Mat quick = drawn.projector_image(0, moved, viewer);
  EXPECT_GT(cv::norm(quick, whole, cv::NORM_INF), 0) << "expected edges with half the samples";
  cv::Mat apart;
  cv::extractChannel(cv::abs(quick - whole), apart, 1);
  EXPECT_LT(cv::countNonZero(apart), 0.03 * static_cast<double>(quick.total()))
      << "expected differences only at edges";
  drawn.set_quick_motion(false);
  EXPECT_EQ(cv::norm(drawn.projector_image(0, moved, viewer), whole, cv::NORM_INF), 0);
  drawn.set_quick_motion(true);
  EXPECT_EQ(cv::norm(drawn.projector_image(0, moved, viewer), quick, cv::NORM_INF), 0)
      << "expected an image that depends on nothing before it";
}

// Only the places of parts that changed are drawn again; the rest is kept.
TEST_F(RendererTest, CompositeOfWhatChangedIsThatOfANewRenderer) {
  const Scene scene =
      scene_of(sheet(0.8, 0.6),
               {slot("near", scene::Mode::view, coloured(sheet(0.12, 0.1, -0.08), {0.5f, 0.4f, 0.3f})),
                slot("far", scene::Mode::view, coloured(sheet(0.15, 0.08, -0.05), {0.1f, 0.6f, 0.2f})),
                slot("decal", scene::Mode::surface, coloured(sheet(0.2, 0.05), {0.2f, 0.3f, 0.8f}))});
  PosedScene posed = posed_at_origin(scene);
  posed.parts[1].world_from_part.translation.x() = 0.16;
  posed.parts[2].world_from_part.translation.y() = 0.12;
  const auto moved_by = [&](std::size_t part, const Vector3d& by) {
    return [&posed, part, by] { posed.parts[part].world_from_part.translation += by; };
  };
  const std::vector<std::function<void()>> changes = {
      [] {},
      moved_by(0, {0.05, 0, 0}),  // before the other part
      moved_by(0, {0, 0.13, 0}),  // before the decal
      moved_by(1, {-0.3, 0, 0.02}),
      moved_by(0, {-0.2, 0, 0}),
      [&] { posed.parts[1].material.base_colour = Vector3d(1, 0, 0); },
      [&] { posed.parts.erase(posed.parts.begin()); },
      [&] {
        posed.world_from_prototype = Pose(exp_rotation({0, 0, 0.1}), {0.02, 0, 0});
      }};
  const cv::Mat image(480, 640, CV_8UC3, cv::Scalar(9, 20, 30));
  Renderer kept = renderer(scene, two_projectors());
  cv::Mat before;
  for (const Composite what : {Composite::full, Composite::rest}) {
    const PosedScene first = posed;
    for (std::size_t i = 0; i < changes.size(); ++i) {
      changes[i]();
      const cv::Mat drawn = kept.composite(0, image, posed, what);
      const cv::Mat anew = renderer(scene, two_projectors()).composite(0, image, posed, what);
      // The ids of the two have other texels. So samples at outlines may differ, but no patch of 3 x 3
      // pixels.
      cv::Mat apart, patches;
      cv::extractChannel(cv::abs(drawn - anew) > 2, apart, 1);
      cv::morphologyEx(apart, patches, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
      EXPECT_LE(cv::countNonZero(apart), 200) << "change " << i;
      EXPECT_EQ(cv::countNonZero(patches), 0) << "change " << i;
      const bool is_change_seen =
          i == 0 || what == Composite::rest || cv::norm(drawn, before, cv::NORM_INF) > 20;
      EXPECT_TRUE(is_change_seen) << "change " << i;
      before = drawn;
    }
    posed = first;
  }
}

// The same surface must be seen whether the mesh bounds a solid, whose back faces are not drawn, or is known
// not to: with a hole that nobody sees, or inside out.
TEST_F(RendererTest, BackFacesOfASolidChangeNothing) {
  Mesh solid = coloured(sheet(0.5, 0.4), {1, 1, 1});
  solid.positions.clear();
  solid.triangles.clear();
  for (int i = 0; i < 8; ++i)
    solid.positions.emplace_back(i & 1 ? 0.25f : -0.25f, i & 2 ? 0.2f : -0.2f, i & 4 ? 0.1f : 0.f);
  for (const auto& [a, b, c, d] : std::vector<std::array<std::uint32_t, 4>>{
           {4, 5, 7, 6}, {0, 2, 3, 1}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}) {
    solid.triangles.push_back({a, b, c});
    solid.triangles.push_back({a, c, d});
  }
  solid.normals.assign(8, {0, 0, -1});
  solid.uvs.assign(8, {0, 0});
  solid.triangle_materials.assign(solid.triangles.size(), 0);
  Mesh open = solid, inside_out = solid;
  open.triangles.erase(open.triangles.begin());  // of the side that faces away
  open.triangle_materials.pop_back();
  for (auto& triangle : inside_out.triangles) std::swap(triangle[0], triangle[1]);
  const auto points_of = [&](const Mesh& mesh) {
    const Scene scene = scene_of(mesh, {});
    return renderer(scene, two_projectors()).surface_points(0, posed_at_origin(scene));
  };
  const cv::Mat expected = points_of(open);
  const cv::Mat is_seen = expected == expected;  // NaN where there is nothing
  for (const Mesh* mesh : {&solid, &inside_out}) {
    cv::Mat found = points_of(*mesh), wanted = expected.clone();
    EXPECT_EQ(cv::norm(found == found, is_seen, cv::NORM_INF), 0);
    cv::patchNaNs(found, 0);
    cv::patchNaNs(wanted, 0);
    EXPECT_LT(cv::norm(found, wanted, cv::NORM_INF), 1e-6);
  }
  cv::Mat one;
  cv::extractChannel(is_seen, one, 0);
  EXPECT_GT(cv::countNonZero(one), 60000);
}

TEST_F(RendererTest, SceneWithoutPrototypeOrProjectorsIsClassicAugmentedReality) {
  Scene scene;
  scene.slots = {slot("mirror", scene::Mode::view, coloured(sheet(0.1, 0.1), {0, 1, 0}))};
  Rig rig;
  rig.cameras = {camera()};
  Renderer drawing = renderer(scene, rig);
  const PosedScene posed = posed_at_origin(scene);
  const cv::Mat image(480, 640, CV_8UC3, cv::Scalar(9, 9, 9));
  for (const Composite what : {Composite::rest, Composite::full}) {
    const cv::Mat out = drawing.composite(0, image, posed, what);
    const Vector2d middle = *rig.cameras[0].project({0, 0, 0});
    EXPECT_EQ(out.at<cv::Vec3b>(static_cast<int>(middle.y()), static_cast<int>(middle.x())),
              cv::Vec3b(0, 255, 0));
    EXPECT_EQ(out.at<cv::Vec3b>(2, 2), cv::Vec3b(9, 9, 9));
  }
  const auto coverage = drawing.coverage(posed, rig.cameras[0]);
  EXPECT_GT(coverage[0].viewer_pixels, 1000);
  EXPECT_EQ(coverage[0].off_surface_share, 1);
}

// The reference for the whole door is Embree, which shares no code with the renderer.
TEST_F(RendererTest, DoorsCoverageAgreesWithARayTracer) {
  const auto loaded = scene::load_scene(std::filesystem::path(LIMN_SOURCE_DIR) / "config/scenes/door");
  ASSERT_TRUE(loaded) << loaded.message();
  const Scene& scene = *loaded;
  // The door's front faces +z with y up, so it is turned into this room's frame.
  const Pose turned(Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Vector3d::UnitX())), Vector3d::Zero());
  PosedScene posed;
  posed.world_from_prototype = turned;
  posed.parts.push_back({"mirror", scene.find_slot("mirror")->variants[0].name,
                         turned * Pose(exp_rotation({0.1, 0.2, 0}), {-0.27, 0.1, 0.1})});
  const Rig rig = two_projectors();
  const Imager viewer = viewer_from({-0.4, -0.3, -1.2});
  Renderer drawing = renderer(scene, rig);
  const auto coverage = drawing.coverage(posed, viewer);
  const scene::Variant& variant = scene.find_slot("mirror")->variants[0];
  const sim::MeshInstance prototype{&scene.prototype->mesh, *posed.world_from_prototype};
  const sim::MeshInstance part{&variant.mesh, posed.parts[0].world_from_part};
  const sim::RayScene prototype_rays(std::span(&prototype, 1)), part_rays(std::span(&part, 1));
  const auto reaches = [&](const Imager& projector, const Vector3d& p, const Vector3d& n) {
    const auto px = projector.project(p);
    const Vector3d p_light = projector.imager_from_world.inverse().translation;
    return px && projector.contains(*px) && n.dot(p_light - p) > 0 && prototype_rays.reached(p_light, p);
  };
  double same = 0, either = 0, on_same = 0, on_either = 0;
  for (int row = 0; row < viewer.height; ++row) {
    for (int column = 0; column < viewer.width; ++column) {
      const Ray ray = *viewer.ray(Vector2d(column, row));
      const sim::Hit hit = part_rays.first_hit(ray), behind = prototype_rays.first_hit(ray);
      int expected = 0;
      if (hit.object >= 0 && (behind.object < 0 || hit.distance < behind.distance)) {
        expected = 128;
        if (behind.object >= 0) {
          const Vector3d p = ray.p_origin + behind.distance * ray.d;
          Vector3d n = prototype_rays.face_normal(behind);
          if (n.dot(ray.d) > 0) n = -n;
          if (reaches(rig.projectors[0], p, n) || reaches(rig.projectors[1], p, n)) expected = 255;
        }
      }
      const int found = coverage[0].mask.at<std::uint8_t>(row, column);
      same += expected > 0 && found > 0;
      either += expected > 0 || found > 0;
      on_same += expected == 255 && found == 255;
      on_either += expected == 255 || found == 255;
    }
  }
  EXPECT_GT(on_either, 1000);
  EXPECT_GT(same / either, 0.99);
  EXPECT_GT(on_same / on_either, 0.99);
  RecordProperty("iou_part", std::to_string(same / either));
  RecordProperty("iou_projected", std::to_string(on_same / on_either));
  std::cout << "IoU part " << same / either << ", projected " << on_same / on_either << "\n";
}

}  // namespace
}  // namespace limn::projector
