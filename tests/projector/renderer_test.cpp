#include "projector/renderer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "core/picture.h"
#include "core/response.h"
#include "projector/treatment.h"
#include "scene/tangents.h"
#include "sim/ray_scene.h"
#include "tests/projector/gl_test.h"
#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using scene::Mesh;
using scene::PosedScene;
using scene::Scene;
using scene::Slot;

// The room of these tests: the prototype's front looks towards -z, where projectors, viewer and camera stand.
const Vector3d k_up(0, -1, 0);

Mesh grid(int columns, int rows, const std::function<Vector3d(double, double)>& at) {
  Mesh mesh;
  for (int r = 0; r <= rows; ++r) {
    for (int c = 0; c <= columns; ++c) {
      mesh.positions.push_back(at(1.0 * c / columns, 1.0 * r / rows).cast<float>());
      mesh.normals.push_back(Eigen::Vector3f(0, 0, -1));
    }
  }
  const auto index = [&](int c, int r) { return static_cast<std::uint32_t>(r * (columns + 1) + c); };
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      mesh.triangles.push_back({index(c, r), index(c, r + 1), index(c + 1, r)});
      mesh.triangles.push_back({index(c + 1, r), index(c, r + 1), index(c + 1, r + 1)});
    }
  }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
}

// A rectangle in a plane of constant z, its middle at the origin.
Mesh sheet(double width, double height, double z = 0, int cells = 7) {
  return grid(cells, cells,
              [=](double u, double v) { return Vector3d((u - 0.5) * width, (v - 0.5) * height, z); });
}

Mesh coloured(Mesh mesh, const Eigen::Vector3f& colour, bool unlit = true) {
  mesh.materials[0].base_colour = colour;
  mesh.materials[0].unlit = unlit;
  return mesh;
}

Imager imager_at(
    const std::string& name, int width, int height, const Vector3d& p_eye, std::vector<double> lens) {
  Imager imager{name, width, height, {}, looking_at(p_eye, {0, 0, 0}, k_up)};
  imager.lens = Lens::create("LENSMODEL_OPENCV4", std::move(lens)).value();
  return imager;
}

Imager projector_left() {
  return imager_at("projector0", 640, 400, {-0.35, -0.1, -1.1},
                   {900, 900, 325, 190, -0.15, 0.1, 0.002, -0.001});
}
Imager projector_right() {
  return imager_at("projector1", 640, 400, {0.35, -0.05, -1.15}, {950, 950, 310, 205, -0.1, 0.05, 0, 0.001});
}
Imager camera() {
  return imager_at("camera0", 640, 480, {0.05, -0.2, -1.3}, {1000, 1000, 320, 240, -0.2, 0.1, 0.001, 0.001});
}
Imager viewer_from(const Vector3d& p_eye) {
  return viewer_imager(looking_at(p_eye, {0, 0, 0}, k_up).inverse(), 640, 480, 35);
}

Rig two_projectors() {
  Rig rig;
  rig.cameras = {camera()};
  rig.projectors = {projector_left(), projector_right()};
  return rig;
}

Slot slot(const std::string& name, scene::Mode mode, Mesh mesh) {
  Slot out;
  out.name = name;
  out.mode = mode;
  out.variants.push_back({"a", std::move(mesh)});
  return out;
}

Scene scene_of(Mesh prototype, std::vector<Slot> slots) {
  Scene scene;
  scene.prototype = scene::Prototype{std::move(prototype), {}, 0.8, {}};
  scene.slots = std::move(slots);
  return scene;
}

PosedScene posed_at_origin(const Scene& scene) {
  PosedScene posed;
  if (scene.prototype) posed.world_from_prototype = Pose();
  for (const Slot& slot : scene.slots) posed.parts.push_back({slot.name, "a", Pose()});
  return posed;
}

// Light of an 8-bit display value, gamma 2.2.
double light_of(std::uint8_t value) { return std::pow(value / 255.0, 2.2); }

// Where the ray meets the rectangle of a sheet() at z; nullopt beside it.
std::optional<Vector3d> on_sheet(const Ray& ray, double width, double height, double z) {
  const double t = (z - ray.p_origin.z()) / ray.d.z();
  const Vector3d p = ray.p_origin + t * ray.d;
  if (!(t > 0) || std::abs(p.x()) > width / 2 || std::abs(p.y()) > height / 2) return std::nullopt;
  return p;
}

// Mean of f over the eight places of a pixel that the renderer samples, too.
double pixel_mean(int column, int row, const std::function<double(const Vector2d&)>& f) {
  const double first = f(Vector2d(column - 0.5, row - 0.5));
  if (first == f(Vector2d(column + 0.5, row - 0.5)) && first == f(Vector2d(column - 0.5, row + 0.5)) &&
      first == f(Vector2d(column + 0.5, row + 0.5))) {
    return first;  // no corner of a sheet pokes into a pixel
  }
  double sum = 0;
  constexpr int k_rows[] = {3, 6, 0, 5, 2, 7, 1, 4};
  for (int k = 0; k < 8; ++k)
    sum += f(Vector2d(column + (k + 0.5) / 8 - 0.5, row + (k_rows[k] + 0.5) / 8 - 0.5));
  return sum / 8;
}

class RendererTest : public test::GlTest {
 protected:
  static Renderer renderer(const Scene& scene, const Rig& rig) {
    auto made = Renderer::create(scene, rig);
    if (!made) throw std::runtime_error(made.message());
    return std::move(made).value();
  }
};

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
  // Triangles well below a pixel near the poles, so that the ids miss most of them.
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
      if (off_axis > 0.99 * k_radius) continue;  // grazing beyond 82 degrees: texels see slivers
      worst = std::max(worst, std::abs(Vector3d(found[0], found[1], found[2]).norm() - k_radius));
    }
  }
  EXPECT_GT(seen, 40000);
  EXPECT_LT(disagreeing, 150);  // 0.2 px of a silhouette of some 800 px
  EXPECT_LT(worst, 6e-5);       // chords of 300 segments sink by 1 to 4e-5 m
}

TEST_F(RendererTest, ViewPartStandsWhereTheViewersEyeSeesIt) {
  // 50 mm off the surface, overhanging its right edge.
  const Eigen::Vector3f colour(0.25f, 0.5f, 0.75f);
  const Scene scene = scene_of(
      sheet(0.5, 0.4), {slot("mirror", scene::Mode::view, coloured(sheet(0.16, 0.1, -0.05), colour))});
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].world_from_part.translation = {0.2, 0.02, 0};
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  for (const Vector3d& p_eye : {Vector3d(-0.3, -0.3, -1.2), Vector3d(0.4, 0.1, -1.0)}) {
    const cv::Mat found = renderer(scene, rig).projector_picture(0, posed, viewer_from(p_eye));
    cv::Mat expected(found.size(), CV_64FC3), light(found.size(), CV_64FC3);
    for (int row = 0; row < found.rows; ++row) {
      for (int column = 0; column < found.cols; ++column) {
        const double cover = pixel_mean(column, row, [&](const Vector2d& px) {
          const auto p = on_sheet(*rig.projectors[0].ray(px), 0.5, 0.4, 0);
          if (!p) return 0;
          const Ray from_eye{p_eye - Vector3d(0.2, 0.02, 0), (*p - p_eye).normalized()};
          return on_sheet(from_eye, 0.16, 0.1, -0.05) ? 1 : 0;
        });
        for (int c = 0; c < 3; ++c) {
          expected.at<cv::Vec3d>(row, column)[c] = cover * static_cast<double>(colour[2 - c]);
          light.at<cv::Vec3d>(row, column)[c] = light_of(found.at<cv::Vec3b>(row, column)[c]);
        }
      }
    }
    EXPECT_GT(cv::sum(expected)[0], 3000);
    // A column of the sixteen samples may fall on the other side of an edge.
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
    const cv::Mat a = drawing.projector_picture(0, posed, viewer_from({-0.3, -0.3, -1.2}));
    const cv::Mat b = drawing.projector_picture(0, posed, viewer_from({0.5, 0.1, -1.0}));
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
  EXPECT_EQ(cv::countNonZero(drawing.projector_picture(0, posed, rig.cameras[0]).reshape(1)), 0);
  const cv::Mat picture(480, 640, CV_8UC3, cv::Scalar(10, 20, 30));
  const cv::Mat full = drawing.composite(0, picture, posed, Composite::full);
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
  EXPECT_LT(wrong, 40);  // half-covered pixels of an outline of some 400
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
  const cv::Mat picture = cv::Mat::zeros(480, 640, CV_8UC1);
  const cv::Mat full = drawing.composite(0, picture, posed, Composite::full);
  const cv::Mat rest = drawing.composite(0, picture, posed, Composite::rest);
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
      const auto is_off = [&](int beside_px) {  // the sheet behind, there or beside
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
  EXPECT_LT(wrong_rest, 80);  // half-covered pixels of an outline of some 1000
}

TEST_F(RendererTest, EachPartOfACompositeIsTreatedInItsOwnWay) {
  const Scene scene = scene_of(
      sheet(0.5, 0.4), {slot("left", scene::Mode::view, coloured(sheet(0.1, 0.1, -0.01), {0, 1, 0})),
                        slot("right", scene::Mode::view, coloured(sheet(0.1, 0.1, -0.01), {1, 0, 0}))});
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].world_from_part.translation.x() = -0.1;
  posed.parts[1].world_from_part.translation.x() = 0.1;
  Renderer drawing = renderer(scene, two_projectors());
  const cv::Mat picture(480, 640, CV_8UC3, cv::Scalar::all(90));
  const cv::Mat full = drawing.composite(0, picture, posed, Composite::full);
  const cv::Mat rest = drawing.composite(0, picture, posed, Composite::rest);
  const cv::Rect left(0, 0, 320, 480), right(320, 0, 320, 480);
  ASSERT_GT(cv::norm(full(left), rest(left), cv::NORM_INF), 30);
  ASSERT_GT(cv::norm(full(right), rest(right), cv::NORM_INF), 30);
  for (const bool left_whole : {true, false, true}) {
    const std::vector<Treatment> treatments = {{"left", left_whole ? Composite::full : Composite::rest, 0},
                                               {"right", left_whole ? Composite::rest : Composite::full, 0}};
    const cv::Mat out = drawing.composite(0, picture, posed, treatments);
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
  const cv::Mat picture(480, 640, CV_8UC3, cv::Scalar(200, 90, 30));
  const auto drawn = [&](double passing) {
    return drawing.composite(0, picture, posed,
                             std::vector<Treatment>{{"mirror", Composite::full, 0, passing}});
  };
  const cv::Mat full = drawn(0), rest = drawn(1);
  EXPECT_EQ(cv::norm(rest, drawing.composite(0, picture, posed, Composite::rest), cv::NORM_INF), 0);
  ASSERT_GT(cv::norm(full, rest, cv::NORM_INF), 100);
  for (const double passing : {0.25, 0.6}) {
    cv::Mat expected(picture.size(), CV_8UC3);
    for (int i = 0; i < static_cast<int>(picture.total()) * 3; ++i) {
      const double light = (1 - passing) * linear_of_srgb(full.data[i] / 255.0) +
                           passing * linear_of_srgb(rest.data[i] / 255.0);
      expected.data[i] = cv::saturate_cast<std::uint8_t>(255 * srgb_of_linear(light));
    }
    EXPECT_LE(cv::norm(drawn(passing), expected, cv::NORM_INF), 3) << passing;
  }
}

TEST_F(RendererTest, WhereNoPartIsTheCompositeIsTheCamerasPicture) {
  const Scene scene = scene_of(sheet(0.3, 0.3), {});
  auto rng = test::test_rng();
  cv::Mat picture(480, 640, CV_8UC3);
  std::generate(picture.begin<cv::Vec3b>(), picture.end<cv::Vec3b>(), [&] {
    const auto v = rng();
    return cv::Vec3b(static_cast<std::uint8_t>(v), static_cast<std::uint8_t>(v >> 8),
                     static_cast<std::uint8_t>(v >> 16));
  });
  const cv::Mat out =
      renderer(scene, two_projectors()).composite(0, picture, posed_at_origin(scene), Composite::full);
  EXPECT_EQ(cv::norm(out, picture, cv::NORM_INF), 0);
}

TEST_F(RendererTest, LightOfTwoProjectorsSumsToThePartsColour) {
  // A white sheet over everything that both reach; 0.5 so that both clipping and rounding would show.
  const Scene scene = scene_of(
      sheet(0.9, 0.7), {slot("paint", scene::Mode::surface, coloured(sheet(0.9, 0.7), {0.5f, 0.5f, 0.5f}))});
  const PosedScene posed = posed_at_origin(scene);
  const Rig rig = two_projectors();
  Renderer drawing = renderer(scene, rig);
  const Imager viewer = viewer_from({0, 0, -1.3});
  cv::Mat light[2];
  for (std::size_t i = 0; i < 2; ++i) {
    const cv::Mat picture = drawing.projector_picture(i, posed, viewer);
    light[i] = cv::Mat(picture.size(), CV_32F);
    for (int row = 0; row < picture.rows; ++row) {
      for (int column = 0; column < picture.cols; ++column) {
        light[i].at<float>(row, column) = static_cast<float>(light_of(picture.at<cv::Vec3b>(row, column)[1]));
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
      // Where two borders cross, the shares turn from 0 to 1 around one point.
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
  EXPECT_LT(worst, 0.02);       // 8 bits at half light are 1.3 % of it, twice over
  EXPECT_LT(worst_step, 0.02);  // the bar for seams, docs: 2 % in linear light
}

TEST_F(RendererTest, BlendSharesTheLightAndMakesUpForMissingBlack) {
  const Scene scene = scene_of(sheet(1.1, 0.7), {});
  const PosedScene posed = posed_at_origin(scene);
  // Side by side, so that a point's pixel in one is 320 pixels beside that in the other.
  constexpr int k_shift = 320;
  const double black[2] = {0.004, 0.01};
  const Vector3d p_eye[2] = {{-0.2, 0, -1}, {0.2, 0, -1}};
  Rig rig;
  for (std::size_t i = 0; i < 2; ++i) {
    const Pose projector_from_world(Eigen::Quaterniond::Identity(), -p_eye[i]);
    rig.projectors.push_back({i == 0 ? "projector0" : "projector1", 640, 400,
                              Lens::pinhole(800, 800, 320, 200), projector_from_world});
    rig.responses.push_back({rig.projectors[i].name, {0, 1}, {0, 1}, {0, 1}});
    rig.responses.back().black_level = Measured{black[i], 0};
  }
  Renderer drawing = renderer(scene, rig);
  const cv::Mat blend[2] = {drawing.blend(0, posed), drawing.blend(1, posed)};
  const cv::Mat points = drawing.surface_points(0, posed);
  const auto irradiance = [&](std::size_t i, const Vector3d& p) {
    return 1 / std::pow((p_eye[i] - p).norm(), 3);
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
  EXPECT_LT(worst, 1e-3);  // a hundredth of a pixel in the soft border
  EXPECT_LT(worst_lift, 1e-4);
}

// Two projectors that differ in nothing but where they are sharp: light is shared by how finely it can be
// drawn.
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
  // A post before the plate keeps the right projector's light from a strip of it.
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
  const cv::Mat left = drawing.projector_picture(0, posed, viewer_from({0, 0, -1.3}));
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
      // A millimetre away from the shadow's outline and inside the plate.
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

// The last triangles of a ball before its outline are seen so much aslant that no texel of ids sees them.
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
    Response response;
    response.projector = projector.name;
    response.black_level = Measured{0.004, 0};
    for (int value = 0; value < 256; ++value)
      response.green.push_back(0.004 + 0.996 * std::pow(value / 255.0, 2.2));
    response.red = response.blue = response.green;
    rig.responses.push_back(response);
  }
  Renderer drawing = renderer(scene, rig);
  const cv::Mat blend = drawing.blend(0, posed_at_origin(scene));
  const cv::Mat points = drawing.surface_points(0, posed_at_origin(scene));
  const sim::PlacedMesh placed{&mesh, Pose()};
  const sim::RayScene truth(std::span(&placed, 1));
  const Vector3d p_right = rig.projectors[1].imager_from_world.inverse().translation;
  int shadowed = 0, lit_in_shadow = 0, dark_in_light = 0;
  for (int row = 0; row < points.rows; ++row) {
    for (int column = 0; column < points.cols; ++column) {
      const auto& p = points.at<cv::Vec3f>(row, column);
      if (std::isnan(p[0]) || p[2] < -0.001F) continue;
      const auto px = rig.projectors[1].project(Vector3d(p[0], p[1], p[2]));
      if (!px || !rig.projectors[1].contains(*px)) continue;
      const bool in_shadow = !truth.lit(p_right, Vector3d(p[0], p[1], p[2]));
      const bool made_up = blend.at<cv::Vec2f>(row, column)[1] > 0;  // for the right one's black
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
    const cv::Mat picture = renderer(scene, used).projector_picture(0, posed_at_origin(scene), viewer);
    EXPECT_EQ(picture.at<cv::Vec3b>(2, 2), cv::Vec3b(0, 0, 0));
    return picture.at<cv::Vec3b>(static_cast<int>(middle.y()), static_cast<int>(middle.x()));
  };
  const cv::Vec3b gamma = at_middle(rig);
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(gamma[2 - c], std::lround(255 * std::pow(static_cast<double>(colour[c]), 1 / 2.2)));
  }
  Response response{"projector0", {}, {}, {}};
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
  const cv::Mat first = drawn.projector_picture(0, posed, viewer);
  EXPECT_GT(cv::countNonZero(first.reshape(1)), 1000);
  EXPECT_FALSE(drawn.pass_times().empty());
  const cv::Mat again = drawn.projector_picture(0, posed, viewer);
  EXPECT_TRUE(drawn.pass_times().empty());
  EXPECT_EQ(cv::norm(first, again, cv::NORM_INF), 0);
  posed.parts[0].world_from_part.translation.x() += 0.01;
  EXPECT_GT(cv::norm(first, drawn.projector_picture(0, posed, viewer), cv::NORM_INF), 10);
  EXPECT_FALSE(drawn.pass_times().empty());
  const cv::Mat from_there = drawn.projector_picture(0, posed, viewer_from({-0.1, -0.2, -1.4}));
  EXPECT_GT(cv::norm(from_there, drawn.projector_picture(0, posed, viewer), cv::NORM_INF), 10);
  // Parts over another picture: only laid over it.
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

  const cv::Mat plain = drawn.projector_picture(0, posed, viewer);
  ASSERT_TRUE(drawn.set_light({.compensation = Compensation::geometry}));
  EXPECT_GT(cv::norm(plain, drawn.projector_picture(0, posed, viewer), cv::NORM_INF), 5);
}

// Whatever is kept from picture to picture.
TEST_F(RendererTest, APictureAfterOthersIsTheSameAsTheFirstOfItsKind) {
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
  anew_in_shadow.set_arriving(1, shadow);
  (void)drawing.projector_picture(0, still, viewer);
  EXPECT_EQ(
      cv::norm(drawing.projector_picture(0, part_moved, viewer),
               renderer(scene, two_projectors()).projector_picture(0, part_moved, viewer), cv::NORM_INF),
      0);
  EXPECT_EQ(cv::norm(drawing.projector_picture(0, all_moved, viewer),
                     anew.projector_picture(0, all_moved, viewer), cv::NORM_INF),
            0);
  drawing.set_arriving(1, shadow);
  const cv::Mat refilled = drawing.projector_picture(0, all_moved, viewer);
  EXPECT_EQ(cv::norm(refilled, anew_in_shadow.projector_picture(0, all_moved, viewer), cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(refilled, anew.projector_picture(0, all_moved, viewer), cv::NORM_INF), 20);
}

TEST_F(RendererTest, WhatMovesIsDrawnQuicklyAndWholeOnceItStandsStill) {
  const Scene scene =
      scene_of(sheet(0.8, 0.6),
               {slot("panel", scene::Mode::view, coloured(sheet(0.3, 0.2, -0.05), {0.5f, 0.4f, 0.3f}))});
  const PosedScene posed = posed_at_origin(scene);
  PosedScene moved = posed;
  moved.parts[0].world_from_part = Pose(exp_rotation({0, 0, 0.1}), {0.011, 0.007, 0});
  const Imager viewer = viewer_from({0.1, -0.2, -1.4});
  const cv::Mat whole = renderer(scene, two_projectors()).projector_picture(0, moved, viewer);

  Renderer drawn = renderer(scene, two_projectors());
  drawn.set_quick_motion(true);
  (void)drawn.projector_picture(0, posed, viewer);
  const cv::Mat quick = drawn.projector_picture(0, moved, viewer);
  EXPECT_GT(cv::norm(quick, whole, cv::NORM_INF), 0) << "edges by half the samples";
  cv::Mat apart;
  cv::extractChannel(cv::abs(quick - whole), apart, 1);
  EXPECT_LT(cv::countNonZero(apart), 0.03 * static_cast<double>(quick.total())) << "and edges alone";
  EXPECT_EQ(cv::norm(drawn.projector_picture(0, moved, viewer), whole, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(drawn.projector_picture(0, moved, viewer), whole, cv::NORM_INF), 0);
}

// Mirrored light of strength pi towards d_eye, of what a colour mirrors head on: GGX, Smith, Fresnel
// (glTF 2.0, appendix B).
Vector3d mirrored(const Vector3d& head_on,
                  double roughness,
                  const Vector3d& n,
                  const Vector3d& d_eye,
                  const Vector3d& d_light) {
  const double nl = n.dot(d_light), nv = n.dot(d_eye), a2 = std::pow(roughness, 4);
  if (nl <= 0) return Vector3d::Zero();
  const Vector3d h = (d_eye + d_light).normalized();
  const double peak = std::pow(n.dot(h), 2) * (a2 - 1) + 1;
  const double visible = nl * std::sqrt(nv * nv * (1 - a2) + a2) + nv * std::sqrt(nl * nl * (1 - a2) + a2);
  const Vector3d fresnel = head_on + (Vector3d::Ones() - head_on) * std::pow(1 - d_eye.dot(h), 5);
  return nl * a2 / (peak * peak) * 0.5 / visible * fresnel;
}

// The look of shaders/look.glsl spelled once more, the soft light direction by direction: below and above a
// horizon that is soft over heights from -0.3 to 0.3, one lamp.
Vector3d lit(const Vector3d& base,
             double metallic,
             double roughness,
             const Vector3d& n,
             const Vector3d& d_eye,
             const scene::RoomLight& room,
             double open = 1) {
  const auto soft = [&](double above) -> Vector3d {
    return open * room.below_rgb + open * above * (room.above_rgb - room.below_rgb);
  };
  const Vector3d diffuse = (1 - metallic) * base;
  const Vector3d head_on = (1 - metallic) * Vector3d::Constant(0.04) + metallic * base;
  const double diffuse_above = 0.5 + 0.5 * n.dot(room.d_up_world);
  Vector3d colour = (Vector3d::Ones() - head_on).cwiseProduct(diffuse).cwiseProduct(soft(diffuse_above));
  const Vector3d d_u = n.unitOrthogonal(), d_v = n.cross(d_u);
  constexpr int k_rings = 300, k_steps = 300;
  for (int i = 0; i < k_rings; ++i)
    for (int k = 0; k < k_steps; ++k) {
      const double z = (i + 0.5) / k_rings, ring = std::sqrt(1 - z * z),
                   angle = 2 * M_PI * (k + 0.5) / k_steps;
      const Vector3d d = ring * (std::cos(angle) * d_u + std::sin(angle) * d_v) + z * n;
      const double t = std::clamp((d.dot(room.d_up_world) + 0.3) / 0.6, 0.0, 1.0);
      const Vector3d light = soft(t * t * (3 - 2 * t)) * (2.0 / (k_rings * k_steps));  // solid angle over pi
      colour += mirrored(head_on, roughness, n, d_eye, d).cwiseProduct(light);
    }
  const Vector3d& d_lamp = room.lamps[0].d_world;
  const Vector3d h = (d_eye + d_lamp).normalized();
  const Vector3d fresnel = head_on + (Vector3d::Ones() - head_on) * std::pow(1 - d_eye.dot(h), 5);
  const Vector3d by_lamp = std::max(0.0, n.dot(d_lamp)) * (Vector3d::Ones() - fresnel).cwiseProduct(diffuse) +
                           mirrored(head_on, roughness, n, d_eye, d_lamp);
  return colour + by_lamp.cwiseProduct(room.lamps[0].strength_rgb);
}

TEST_F(RendererTest, MetalAndGlossAreAsInGltf) {
  for (const auto& [metallic, roughness] : {std::pair(1.0f, 0.3f), {0.0f, 0.4f}, {0.5f, 0.7f}}) {
    Mesh mesh = coloured(sheet(0.5, 0.4), {0.7f, 0.45f, 0.2f}, false);
    mesh.materials[0].metallic = metallic;
    mesh.materials[0].roughness = roughness;
    Scene scene = scene_of(sheet(0.1, 0.1, 2), {slot("panel", scene::Mode::view, mesh)});
    scene.light = scene::RoomLight{k_up,
                                   {0.05, 0.08, 0.1},
                                   {0.3, 0.28, 0.25},
                                   {{Vector3d(0.2, -0.5, -1).normalized(), {0.5, 0.45, 0.4}}}};
    const Rig rig = two_projectors();
    Renderer drawing = renderer(scene, rig);
    const cv::Mat seen =
        drawing.composite(0, cv::Mat::zeros(480, 640, CV_8UC1), posed_at_origin(scene), Composite::full);
    double worst = 0;
    for (int row = 140; row <= 340; row += 50)
      for (int column = 200; column <= 440; column += 40) {
        const Ray ray = *rig.cameras[0].ray(Vector2d(column, row));
        const Vector3d wanted = lit({0.7, 0.45, 0.2}, metallic, roughness, {0, 0, -1}, -ray.d, *scene.light);
        const auto& bgr = seen.at<cv::Vec3b>(row, column);
        for (int c = 0; c < 3; ++c)
          worst = std::max(worst, std::abs(bgr[2 - c] - 255 * srgb_of_linear(std::min(1.0, wanted[c]))));
      }
    EXPECT_LT(worst, 1) << "of 255, metallic " << metallic << ", roughness " << roughness;
  }
}

// A sheet of 0.2 x 0.2 m in four fields, two by two, that differ in their maps alone.
constexpr double k_normal_scale = 0.5, k_flat = k_normal_scale * (2 * 128 / 255.0 - 1);  // 8 bits have no 0
struct Field {
  double metallic = 0, roughness = 0.6, open = 1;
  Vector3d along = {k_flat, k_flat, 1};  // the map's normal: to the right, up, out of the sheet
  double glow = 0;
};
constexpr double k_field_glow = 100 / 255.0;
const Field k_fields[] = {
    {.metallic = 1, .roughness = 0.4},
    {.along = Vector3d(0.5 * (2 * 200 / 255.0 - 1), 0.5 * (2 * 60 / 255.0 - 1), 2 * 220 / 255.0 - 1)},
    {.open = 0.5},
    {.glow = 1}};
const Vector3d k_field_colour(0.7, 0.45, 0.2);

Mesh fields(double z) {
  Mesh part = coloured(sheet(0.2, 0.2, z), k_field_colour.cast<float>(), false);
  for (const auto& p : part.positions) part.uvs.push_back({p.x() / 0.2f + 0.5f, 0.5f - p.y() / 0.2f});
  constexpr int k_side = 64;
  const auto picture = [&](const cv::Scalar& colour) {
    return cv::Mat(2 * k_side, 2 * k_side, CV_8UC3, colour);
  };
  const auto field = [&](cv::Mat& whole, int k) {
    return whole(cv::Rect(k % 2 * k_side, k / 2 * k_side, k_side, k_side));
  };
  scene::Material& material = part.materials[0];
  scene::SurfaceMaps& maps = material.maps;
  cv::Mat rough = picture({0, 153, 0}), normals = picture({255, 128, 128}), open = picture({0, 0, 255}),
          glow = picture({});
  field(rough, 0).setTo(cv::Scalar(255, 102, 0));
  field(normals, 1).setTo(cv::Scalar(220, 60, 200));
  field(open, 2).setTo(cv::Scalar(255, 255, 51));  // of which the strength takes 5 / 8
  field(glow, 3).setTo(cv::Scalar(188, 188, 188));
  material.metallic = material.roughness = 1;
  material.emitted = Eigen::Vector3f::Constant(static_cast<float>(k_field_glow));
  maps.metallic_roughness.picture = rough;
  maps.normals.picture = normals;
  maps.occlusion.picture = open;
  maps.emission.picture = glow;
  maps.normal_scale = static_cast<float>(k_normal_scale);
  maps.occlusion_strength = 0.625f;
  scene::add_tangents(&part);
  return part;
}

Vector3d middle_of_field(int k, double z) { return {k % 2 ? 0.05 : -0.05, k / 2 ? 0.05 : -0.05, z}; }

// Of the middle of a field, the sheet facing -z with up -y.
Vector3d wanted_of_field(int k, const Vector3d& d_eye, const scene::RoomLight& room) {
  const Field& field = k_fields[k];
  const Vector3d n = Vector3d(field.along.x(), -field.along.y(), -field.along.z()).normalized();
  return lit(k_field_colour, field.metallic, field.roughness, n, d_eye, room, field.open) +
         Vector3d::Constant(field.glow * k_field_glow * linear_of_srgb(188 / 255.0));
}

// Levels between a picture's colour where p is and a wanted colour, by the encoding of what shows it.
double levels_off(const cv::Mat& bgr,
                  const Imager& imager,
                  const Vector3d& p,
                  const Vector3d& wanted,
                  const std::function<double(double)>& encoded) {
  const Vector2d px = *imager.project(p);
  const auto& found = bgr.at<cv::Vec3b>(cvRound(px.y()), cvRound(px.x()));
  double worst = 0;
  for (int c = 0; c < 3; ++c)
    worst = std::max(worst, std::abs(found[2 - c] - 255 * encoded(std::min(1.0, wanted[c]))));
  return worst;
}

TEST_F(RendererTest, MapsOfASurfaceAreReadInLightCompositesAndViews) {
  const scene::RoomLight room{
      k_up, {0.05, 0.08, 0.1}, {0.3, 0.28, 0.25}, {{Vector3d(0.2, -0.5, -1).normalized(), {0.5, 0.45, 0.4}}}};
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  const Imager &eye = rig.cameras[0], &projector = rig.projectors[0];
  const Imager viewer = viewer_from({-0.3, -0.3, -1.2});
  const Vector3d p_eye = eye.imager_from_world.inverse().translation;
  const Vector3d p_viewer = viewer.imager_from_world.inverse().translation;
  const auto srgb = [](double light) { return srgb_of_linear(light); };
  const auto gamma = [](double light) { return std::pow(light, 1 / 2.2); };
  for (const scene::Mode mode : {scene::Mode::view, scene::Mode::surface}) {
    const double z = mode == scene::Mode::view ? -0.05 : -0.0005;
    Scene scene = scene_of(sheet(0.5, 0.4), {slot("panel", mode, fields(z))});
    scene.light = room;
    const PosedScene posed = posed_at_origin(scene);
    Renderer drawing = renderer(scene, rig);
    const cv::Mat composite = drawing.composite(0, cv::Mat::zeros(480, 640, CV_8UC1), posed, Composite::full);
    const cv::Mat view = drawing.view(eye, posed, cv::Scalar());
    const cv::Mat light = drawing.projector_picture(0, posed, viewer);
    for (int k = 0; k < 4; ++k) {
      const Vector3d p = middle_of_field(k, z), d_eye = (p_eye - p).normalized(),
                     d_viewer = (p_viewer - p).normalized();
      const bool on_surface = mode == scene::Mode::surface;
      const Vector3d d_up(0, 0, -1);
      SCOPED_TRACE(fmt::format("field {} {}", k, on_surface ? "on the surface" : "for the viewer"));
      const Vector3d seen = wanted_of_field(k, on_surface ? d_up : d_eye, room);
      EXPECT_LT(levels_off(composite, eye, p, seen, srgb), 1.5);
      EXPECT_LT(levels_off(view, eye, p, wanted_of_field(k, d_eye, room), srgb), 1.5);
      const Vector3d p_lit =
          on_surface ? p : Vector3d(p - d_viewer * (z / d_viewer.z()));  // where the viewer sees it
      EXPECT_LT(
          levels_off(light, projector, p_lit, wanted_of_field(k, on_surface ? d_up : d_viewer, room), gamma),
          1.5);
    }
  }
}

// A scene without maps is drawn by programs without them; one part's maps change nothing of the others.
TEST_F(RendererTest, MapsOfOnePartLeaveOthersAsTheyAre) {
  const Mesh plain = coloured(sheet(0.1, 0.1, -0.02), {0.3f, 0.6f, 0.1f}, false);
  Mesh glossy = coloured(sheet(0.1, 0.1, -0.03), {0.3f, 0.6f, 0.1f}, false);
  glossy.materials[0].roughness = 0.5f;
  for (auto& p : glossy.positions) p.y() += 0.15f;
  std::vector<Slot> slots = {slot("plain", scene::Mode::view, plain),
                             slot("glossy", scene::Mode::view, glossy)};
  const Rig rig = two_projectors();
  const cv::Mat black = cv::Mat::zeros(480, 640, CV_8UC1);
  const Scene without = scene_of(sheet(0.5, 0.4), slots);
  Mesh aside = fields(-0.01);
  for (auto& p : aside.positions) p.x() += 0.25f;
  slots.push_back(slot("fields", scene::Mode::view, aside));
  const Scene with = scene_of(sheet(0.5, 0.4), slots);
  PosedScene posed = posed_at_origin(with);
  posed.parts.pop_back();
  const cv::Mat wanted = renderer(without, rig).composite(0, black, posed, Composite::full);
  EXPECT_GT(cv::countNonZero(wanted.reshape(1)), 5000);
  EXPECT_EQ(cv::norm(renderer(with, rig).composite(0, black, posed, Composite::full), wanted, cv::NORM_INF),
            0);
}

// What people chose instead is drawn as if the files had said it, and what they chose not as the files say.
TEST_F(RendererTest, DrawsOtherMaterialsAndLightFromPictureToPicture) {
  const scene::RoomLight evening{
      k_up, {0.05, 0.08, 0.1}, {0.3, 0.28, 0.25}, {{Vector3d(0.2, -0.5, -1).normalized(), {0.5, 0.45, 0.4}}}};
  Mesh own = coloured(sheet(0.5, 0.4), {0.2f, 0.4f, 0.6f}, true), other = own;
  other.materials[0] = {
      .base_colour = {0.7f, 0.45f, 0.2f}, .metallic = 0.5f, .roughness = 0.3f, .texture = {}};
  // A trim behind it shows that other slots keep their own.
  Mesh trim = coloured(sheet(0.1, 0.7, 0.01), {0.1f, 0.5f, 0.1f}, false);
  const std::vector<scene::Slot> slots = {slot("panel", scene::Mode::view, own),
                                          slot("trim", scene::Mode::view, trim)};
  const Scene scene = scene_of(sheet(0.1, 0.1, 2), slots);
  Scene wanted_scene = scene_of(sheet(0.1, 0.1, 2), slots);
  wanted_scene.slots[0] = slot("panel", scene::Mode::view, other);
  wanted_scene.light = evening;
  const Rig rig = two_projectors();
  const cv::Mat black = cv::Mat::zeros(480, 640, CV_8UC1);
  PosedScene posed = posed_at_origin(scene);
  Renderer drawing = renderer(scene, rig);
  const auto seen = [&] { return drawing.composite(0, black, posed, Composite::full); };
  const cv::Mat before = seen();
  posed.parts[0].material = {Vector3d(0.7, 0.45, 0.2), 0.5, 0.3};
  posed.light = evening;
  const cv::Mat wanted =
      renderer(wanted_scene, rig).composite(0, black, posed_at_origin(wanted_scene), Composite::full);
  EXPECT_TRUE(test::image_near(seen(), wanted, 0.01, 1, "chosen"));
  EXPECT_GT(cv::norm(before, wanted, cv::NORM_INF), 60);
  posed.parts[0].material = {};
  const cv::Mat own_in_other_light = seen();
  EXPECT_EQ(own_in_other_light.at<cv::Vec3b>(240, 240), before.at<cv::Vec3b>(240, 240));  // unlit
  EXPECT_NE(own_in_other_light.at<cv::Vec3b>(60, 320), before.at<cv::Vec3b>(60, 320));    // the trim
  posed.light.reset();
  EXPECT_EQ(cv::norm(before, seen(), cv::NORM_INF), 0);
  // A colour alone leaves an unlit part unlit.
  posed.parts[0].material.base_colour = Vector3d(1, 0, 0);
  EXPECT_EQ(seen().at<cv::Vec3b>(240, 240), cv::Vec3b(0, 0, 255));
}

TEST_F(RendererTest, TextureStandsTheRightWayUp) {
  // Left half red, top half bright, as seen by a viewer whose picture's down is +y.
  Mesh part = coloured(sheet(0.2, 0.2, -0.001), {1, 1, 1});
  for (const auto& p : part.positions) part.uvs.push_back({p.x() / 0.2f + 0.5f, 0.5f - p.y() / 0.2f});
  cv::Mat texture(64, 64, CV_8UC3, cv::Scalar(0, 0, 255));
  texture(cv::Rect(32, 0, 32, 64)).setTo(cv::Scalar(255, 0, 0));
  texture(cv::Rect(0, 32, 64, 32)) *= 0.5;
  part.materials[0].texture = texture;
  const Scene scene = scene_of(sheet(0.5, 0.4), {slot("paint", scene::Mode::view, part)});
  const Rig rig = two_projectors();
  const cv::Mat out =
      renderer(scene, rig)
          .composite(0, cv::Mat::zeros(480, 640, CV_8UC3), posed_at_origin(scene), Composite::full);
  const auto colour_at = [&](double x, double y) {
    const Vector2d px = *rig.cameras[0].project({x, y, -0.001});
    return out.at<cv::Vec3b>(static_cast<int>(px.y()), static_cast<int>(px.x()));
  };
  EXPECT_EQ(colour_at(-0.05, -0.05), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(colour_at(0.05, -0.05), cv::Vec3b(255, 0, 0));
  EXPECT_NEAR(colour_at(-0.05, 0.05)[2], 128, 1);
}

// A ring on a sheet of 0.2 x 0.2 m: what is beside it is cut out, in a colour that must not be seen.
constexpr double k_ring_in = 0.04, k_ring_out = 0.08;
bool is_on_ring(double x, double y) { return std::hypot(x, y) > k_ring_in && std::hypot(x, y) < k_ring_out; }

Mesh ring(double z, const cv::Scalar& colour_bgr) {
  Mesh part = coloured(sheet(0.2, 0.2, z), {1, 1, 1});
  for (const auto& p : part.positions) part.uvs.push_back({p.x() / 0.2f + 0.5f, 0.5f - p.y() / 0.2f});
  constexpr int k_side = 512;
  cv::Mat texture(k_side, k_side, CV_8UC4, cv::Scalar(colour_bgr[0], colour_bgr[1], colour_bgr[2], 0));
  for (int row = 0; row < k_side; ++row)
    for (int column = 0; column < k_side; ++column)
      if (is_on_ring(0.2 * (column + 0.5) / k_side - 0.1, 0.2 * (row + 0.5) / k_side - 0.1))
        texture.at<cv::Vec4b>(row, column)[3] = 255;
  part.materials[0].texture = texture;
  part.materials[0].cut_below = 0.5f;
  return part;
}

TEST_F(RendererTest, WhatAMaterialCutsOutIsNotThere) {
  // Through the hole in the ring another part is seen, and the camera's picture around it.
  const cv::Scalar red(0, 0, 255), grey(90, 90, 90);
  const Scene scene = scene_of(
      sheet(0.5, 0.4), {slot("ring", scene::Mode::view, ring(-0.05, red)),
                        slot("plate", scene::Mode::view, coloured(sheet(0.1, 0.1, -0.02), {0, 1, 0}))});
  const Rig rig = two_projectors();
  const Imager& camera = rig.cameras[0];
  const cv::Mat picture(480, 640, CV_8UC3, grey);
  const cv::Mat found = renderer(scene, rig).composite(0, picture, posed_at_origin(scene), Composite::full);
  int green = 0, wrong = 0;
  double ring_found = 0, ring_expected = 0;
  for (int row = 0; row < found.rows; ++row)
    for (int column = 0; column < found.cols; ++column) {
      const auto seen_at = [&](const Vector2d& px) {
        const Ray ray = *camera.ray(px);
        const auto p = on_sheet(ray, 0.2, 0.2, -0.05);
        if (p && is_on_ring(p->x(), p->y())) return 2;
        return on_sheet(ray, 0.1, 0.1, -0.02) ? 1 : 0;
      };
      const int seen = seen_at(Vector2d(column, row));
      const auto& colour = found.at<cv::Vec3b>(row, column);
      ring_expected += pixel_mean(column, row, [&](const Vector2d& px) { return seen_at(px) == 2 ? 1 : 0; });
      ring_found += colour[2] == 90 ? 0 : light_of(colour[2]);
      bool is_inside = true;  // no edge within a pixel
      for (int k = 0; k < 9 && is_inside; ++k)
        is_inside = seen_at(Vector2d(column + k % 3 - 1, row + k / 3 - 1)) == seen;
      if (!is_inside) continue;
      const cv::Vec3b wanted = seen == 2   ? cv::Vec3b(0, 0, 255)
                               : seen == 1 ? cv::Vec3b(0, 255, 0)
                                           : cv::Vec3b(90, 90, 90);
      wrong += colour != wanted;
      green += seen == 1;
    }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(green, 500);
  EXPECT_NEAR(ring_found, ring_expected, 0.01 * ring_expected);  // edges by their share
}

TEST_F(RendererTest, WhatAMaterialCutsOutGivesNoLight) {
  const Rig rig = two_projectors();
  for (const scene::Mode mode : {scene::Mode::view, scene::Mode::surface}) {
    const double z = mode == scene::Mode::view ? -0.05 : -0.0005;
    const Scene scene = scene_of(sheet(0.5, 0.4), {slot("ring", mode, ring(z, {255, 255, 255}))});
    Renderer drawing = renderer(scene, rig);
    const Vector3d p_eye(-0.3, -0.3, -1.2);
    const PosedScene posed = posed_at_origin(scene);
    const cv::Mat light = drawing.projector_picture(0, posed, viewer_from(p_eye));
    int same = 0, either = 0, beside = 0;
    for (int row = 0; row < light.rows; ++row)
      for (int column = 0; column < light.cols; ++column) {
        const auto expected_at = [&](const Vector2d& px) {
          const auto p = on_sheet(*rig.projectors[0].ray(px), 0.5, 0.4, 0);
          if (!p) return false;
          if (mode == scene::Mode::surface) return is_on_ring(p->x(), p->y());
          const auto q = on_sheet(Ray{p_eye, (*p - p_eye).normalized()}, 0.2, 0.2, z);
          return q && is_on_ring(q->x(), q->y());
        };
        const bool expected = expected_at(Vector2d(column, row));
        const bool is_lit = light.at<cv::Vec3b>(row, column)[1] > 0;
        const bool is_bright = light_of(light.at<cv::Vec3b>(row, column)[1]) > 0.2;  // half of a half share
        same += expected && is_bright;
        either += expected || is_bright;
        bool is_near = false;
        for (int k = 0; k < 9; ++k) is_near |= expected_at(Vector2d(column + k % 3 - 1, row + k / 3 - 1));
        beside += is_lit && !is_near;
      }
    EXPECT_GT(either, 5000);
    EXPECT_GT(1.0 * same / either, 0.98) << (mode == scene::Mode::view ? "view" : "surface");
    EXPECT_EQ(beside, 0);
  }
}

// The judge goes through what is cut out, too.
TEST_F(RendererTest, CutOutPartsAgreeWithARayTracer) {
  const Mesh part = ring(-0.05, {0, 0, 255});
  const Scene scene = scene_of(sheet(0.5, 0.4), {slot("ring", scene::Mode::view, part)});
  const Rig rig = two_projectors();
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].world_from_part = Pose(exp_rotation({0.4, -0.5, 0.3}), {0.02, 0.01, -0.1});
  const cv::Mat found =
      renderer(scene, rig).composite(0, cv::Mat::zeros(480, 640, CV_8UC3), posed, Composite::full);
  const sim::PlacedMesh placed{&part, posed.parts[0].world_from_part};
  const sim::RayScene rays(std::span(&placed, 1));
  int same = 0, either = 0;
  for (int row = 0; row < found.rows; ++row)
    for (int column = 0; column < found.cols; ++column) {
      const bool expected = rays.first_hit(*rig.cameras[0].ray(Vector2d(column, row))).object >= 0;
      const bool is_drawn = light_of(found.at<cv::Vec3b>(row, column)[2]) > 0.5;
      same += expected && is_drawn;
      either += expected || is_drawn;
    }
  EXPECT_GT(either, 5000);
  EXPECT_GT(1.0 * same / either, 0.99);
}

TEST_F(RendererTest, SceneWithoutPrototypeOrProjectorsIsClassicAugmentedReality) {
  Scene scene;
  scene.slots = {slot("mirror", scene::Mode::view, coloured(sheet(0.1, 0.1), {0, 1, 0}))};
  Rig rig;
  rig.cameras = {camera()};
  Renderer drawing = renderer(scene, rig);
  const PosedScene posed = posed_at_origin(scene);
  const cv::Mat picture(480, 640, CV_8UC3, cv::Scalar(9, 9, 9));
  for (const Composite what : {Composite::rest, Composite::full}) {
    const cv::Mat out = drawing.composite(0, picture, posed, what);
    const Vector2d middle = *rig.cameras[0].project({0, 0, 0});
    EXPECT_EQ(out.at<cv::Vec3b>(static_cast<int>(middle.y()), static_cast<int>(middle.x())),
              cv::Vec3b(0, 255, 0));
    EXPECT_EQ(out.at<cv::Vec3b>(2, 2), cv::Vec3b(9, 9, 9));
  }
  const auto coverage = drawing.coverage(posed, rig.cameras[0]);
  EXPECT_GT(coverage[0].viewer_pixels, 1000);
  EXPECT_EQ(coverage[0].off_surface_share, 1);
}

// The judge of the whole door: Embree, which shares no code with the renderer.
TEST_F(RendererTest, DoorsCoverageAgreesWithARayTracer) {
  const auto loaded = scene::load_scene(std::filesystem::path(LIMN_SOURCE_DIR) / "config/scenes/door");
  ASSERT_TRUE(loaded) << loaded.message();
  const Scene& scene = *loaded;
  // The door's front looks to +z with y up: turn it into this room.
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
  const sim::PlacedMesh prototype{&scene.prototype->mesh, *posed.world_from_prototype};
  const sim::PlacedMesh part{&variant.mesh, posed.parts[0].world_from_part};
  const sim::RayScene prototype_rays(std::span(&prototype, 1)), part_rays(std::span(&part, 1));
  const auto reaches = [&](const Imager& projector, const Vector3d& p, const Vector3d& n) {
    const auto px = projector.project(p);
    const Vector3d p_light = projector.imager_from_world.inverse().translation;
    return px && projector.contains(*px) && n.dot(p_light - p) > 0 && prototype_rays.lit(p_light, p);
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
