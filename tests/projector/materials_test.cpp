// Materials of parts: metal and gloss, textures and maps, alpha cutoff.
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/image_io.h"
#include "core/photometric_response.h"
#include "projector/composite_policy.h"
#include "scene/meshes/tangents.h"
#include "sim/ray_scene.h"
#include "tests/projector/sheet_room.h"
#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

using MaterialsTest = RendererTest;

// Light of strength pi reflected towards d_view by a surface with reflectance `f0` at normal incidence:
// GGX, Smith, Fresnel (glTF 2.0, appendix B).
Vector3d specular(const Vector3d& f0,
                  double roughness,
                  const Vector3d& n,
                  const Vector3d& d_view,
                  const Vector3d& d_light) {
  const double nl = n.dot(d_light), nv = n.dot(d_view), a2 = std::pow(roughness, 4);
  if (nl <= 0) return Vector3d::Zero();
  const Vector3d h = (d_view + d_light).normalized();
  const double peak = std::pow(n.dot(h), 2) * (a2 - 1) + 1;
  const double visible = nl * std::sqrt(nv * nv * (1 - a2) + a2) + nv * std::sqrt(nl * nl * (1 - a2) + a2);
  const Vector3d fresnel = f0 + (Vector3d::Ones() - f0) * std::pow(1 - d_view.dot(h), 5);
  return nl * a2 / (peak * peak) * 0.5 / visible * fresnel;
}

// A second implementation of shaders/shading.glsl that sums the soft light over directions. Its horizon is
// smooth over heights from -0.3 to 0.3; there is one lamp.
Vector3d shaded(const Vector3d& base,
                double metallic,
                double roughness,
                const Vector3d& n,
                const Vector3d& d_view,
                const scene::RoomLight& room,
                double open = 1) {
  const auto soft = [&](double above) -> Vector3d {
    return open * room.below_rgb + open * above * (room.above_rgb - room.below_rgb);
  };
  const Vector3d diffuse = (1 - metallic) * base;
  const Vector3d f0 = (1 - metallic) * Vector3d::Constant(0.04) + metallic * base;
  const double diffuse_above = 0.5 + 0.5 * n.dot(room.d_up_world);
  Vector3d colour = (Vector3d::Ones() - f0).cwiseProduct(diffuse).cwiseProduct(soft(diffuse_above));
  const Vector3d d_u = n.unitOrthogonal(), d_v = n.cross(d_u);
  constexpr int k_rings = 300, k_steps = 300;
  for (int i = 0; i < k_rings; ++i)
    for (int k = 0; k < k_steps; ++k) {
      const double z = (i + 0.5) / k_rings, ring = std::sqrt(1 - z * z),
                   angle = 2 * M_PI * (k + 0.5) / k_steps;
      const Vector3d d = ring * (std::cos(angle) * d_u + std::sin(angle) * d_v) + z * n;
      const double t = std::clamp((d.dot(room.d_up_world) + 0.3) / 0.6, 0.0, 1.0);
      // Solid angle divided by pi.
      const Vector3d light = soft(t * t * (3 - 2 * t)) * (2.0 / (k_rings * k_steps));
      colour += specular(f0, roughness, n, d_view, d).cwiseProduct(light);
    }
  const Vector3d& d_lamp = room.lamps[0].d_world;
  const Vector3d h = (d_view + d_lamp).normalized();
  const Vector3d fresnel = f0 + (Vector3d::Ones() - f0) * std::pow(1 - d_view.dot(h), 5);
  const Vector3d by_lamp = std::max(0.0, n.dot(d_lamp)) * (Vector3d::Ones() - fresnel).cwiseProduct(diffuse) +
                           specular(f0, roughness, n, d_view, d_lamp);
  return colour + by_lamp.cwiseProduct(room.lamps[0].strength_rgb);
}

TEST_F(MaterialsTest, MetalAndGlossAreAsInGltf) {
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
        const Vector3d wanted =
            shaded({0.7, 0.45, 0.2}, metallic, roughness, {0, 0, -1}, -ray.d, *scene.light);
        const auto& bgr = seen.at<cv::Vec3b>(row, column);
        for (int c = 0; c < 3; ++c)
          worst = std::max(worst, std::abs(bgr[2 - c] - 255 * srgb_from_linear(std::min(1.0, wanted[c]))));
      }
    EXPECT_LT(worst, 1) << "of 255, metallic " << metallic << ", roughness " << roughness;
  }
}

// A sheet of 0.2 x 0.2 m with four fields, two by two, which differ only in their maps.
// 8 bits cannot store 0 exactly.
constexpr double k_normal_scale = 0.5, k_flat = k_normal_scale * (2 * 128 / 255.0 - 1);
struct Field {
  double metallic = 0, roughness = 0.6, open = 1;
  Vector3d along = {k_flat, k_flat, 1};  // the map's normal: right, up, out of the sheet
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
  const auto image = [&](const cv::Scalar& colour) {
    return cv::Mat(2 * k_side, 2 * k_side, CV_8UC3, colour);
  };
  const auto field = [&](cv::Mat& whole, int k) {
    return whole(cv::Rect(k % 2 * k_side, k / 2 * k_side, k_side, k_side));
  };
  scene::Material& material = part.materials[0];
  scene::SurfaceMaps& maps = material.maps;
  cv::Mat rough = image({0, 153, 0}), normals = image({255, 128, 128}), open = image({0, 0, 255}),
          glow = image({});
  field(rough, 0).setTo(cv::Scalar(255, 102, 0));
  field(normals, 1).setTo(cv::Scalar(220, 60, 200));
  field(open, 2).setTo(cv::Scalar(255, 255, 51));  // the strength of the occlusion is 5 / 8
  field(glow, 3).setTo(cv::Scalar(188, 188, 188));
  material.metallic = material.roughness = 1;
  material.emitted = Eigen::Vector3f::Constant(static_cast<float>(k_field_glow));
  maps.metallic_roughness.image = rough;
  maps.normals.image = normals;
  maps.occlusion.image = open;
  maps.emission.image = glow;
  maps.normal_scale = static_cast<float>(k_normal_scale);
  maps.occlusion_strength = 0.625f;
  scene::add_tangents(&part);
  return part;
}

Vector3d middle_of_field(int k, double z) { return {k % 2 ? 0.05 : -0.05, k / 2 ? 0.05 : -0.05, z}; }

// The expected colour in the middle of field k; the sheet faces -z, up is -y.
Vector3d wanted_of_field(int k, const Vector3d& d_view, const scene::RoomLight& room) {
  const Field& field = k_fields[k];
  const Vector3d n = Vector3d(field.along.x(), -field.along.y(), -field.along.z()).normalized();
  return shaded(k_field_colour, field.metallic, field.roughness, n, d_view, room, field.open) +
         Vector3d::Constant(field.glow * k_field_glow * linear_from_srgb(188 / 255.0));
}

// The difference in levels between an image's colour at point p and a wanted colour, in the encoding of the
// device that shows it.
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

TEST_F(MaterialsTest, MapsOfASurfaceAreReadInLightCompositesAndViews) {
  const scene::RoomLight room{
      k_up, {0.05, 0.08, 0.1}, {0.3, 0.28, 0.25}, {{Vector3d(0.2, -0.5, -1).normalized(), {0.5, 0.45, 0.4}}}};
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  const Imager &camera = rig.cameras[0], &projector = rig.projectors[0];
  const Imager viewer = viewer_from({-0.3, -0.3, -1.2});
  const Vector3d p_camera = camera.imager_from_world.inverse().translation;
  const Vector3d p_viewer = viewer.imager_from_world.inverse().translation;
  const auto srgb = [](double light) { return srgb_from_linear(light); };
  const auto gamma = [](double light) { return std::pow(light, 1 / 2.2); };
  for (const scene::Mode mode : {scene::Mode::view, scene::Mode::surface}) {
    const double z = mode == scene::Mode::view ? -0.05 : -0.0005;
    Scene scene = scene_of(sheet(0.5, 0.4), {slot("panel", mode, fields(z))});
    scene.light = room;
    const PosedScene posed = posed_at_origin(scene);
    Renderer drawing = renderer(scene, rig);
    const cv::Mat composite = drawing.composite(0, cv::Mat::zeros(480, 640, CV_8UC1), posed, Composite::full);
    const cv::Mat view = drawing.view(camera, posed, cv::Scalar());
    const cv::Mat light = drawing.projector_image(0, posed, viewer);
    for (int k = 0; k < 4; ++k) {
      const Vector3d p = middle_of_field(k, z), d_view = (p_camera - p).normalized(),
                     d_viewer = (p_viewer - p).normalized();
      const bool on_surface = mode == scene::Mode::surface;
      const Vector3d d_up(0, 0, -1);
      SCOPED_TRACE(fmt::format("field {} {}", k, on_surface ? "on the surface" : "for the viewer"));
      const Vector3d seen = wanted_of_field(k, on_surface ? d_up : d_view, room);
      EXPECT_LT(levels_off(composite, camera, p, seen, srgb), 1.5);
      EXPECT_LT(levels_off(view, camera, p, wanted_of_field(k, d_view, room), srgb), 1.5);
      const Vector3d p_lit =
          on_surface ? p : Vector3d(p - d_viewer * (z / d_viewer.z()));  // where the viewer sees the field
      EXPECT_LT(
          levels_off(light, projector, p_lit, wanted_of_field(k, on_surface ? d_up : d_viewer, room), gamma),
          1.5);
    }
  }
}

// A scene without maps is drawn by programs without maps. The maps of one part must not change the other
// parts.
TEST_F(MaterialsTest, MapsOfOnePartLeaveOthersAsTheyAre) {
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

// Material overrides are drawn as if they were in the files; everything else stays as in the files.
TEST_F(MaterialsTest, DrawsOtherMaterialsAndLightFromImageToImage) {
  const scene::RoomLight evening{
      k_up, {0.05, 0.08, 0.1}, {0.3, 0.28, 0.25}, {{Vector3d(0.2, -0.5, -1).normalized(), {0.5, 0.45, 0.4}}}};
  Mesh own = coloured(sheet(0.5, 0.4), {0.2f, 0.4f, 0.6f}, true), other = own;
  other.materials[0] = {
      .base_colour = {0.7f, 0.45f, 0.2f}, .metallic = 0.5f, .roughness = 0.3f, .texture = {}};
  // A trim behind it shows that other slots keep their materials.
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
  // An override of only the colour leaves an unlit part unlit.
  posed.parts[0].material.base_colour = Vector3d(1, 0, 0);
  EXPECT_EQ(seen().at<cv::Vec3b>(240, 240), cv::Vec3b(0, 0, 255));
}

TEST_F(MaterialsTest, TextureStandsTheRightWayUp) {
  // The left half is red and the top half is bright for a viewer with +y down in the image.
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

// A ring on a sheet of 0.2 x 0.2 m. The rest is cut out, and has a colour that must not be visible.
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

TEST_F(MaterialsTest, WhatAMaterialCutsOutIsNotThere) {
  // Another part is visible through the hole in the ring, and the camera's image around the ring.
  const cv::Scalar red(0, 0, 255), grey(90, 90, 90);
  const Scene scene = scene_of(
      sheet(0.5, 0.4), {slot("ring", scene::Mode::view, ring(-0.05, red)),
                        slot("plate", scene::Mode::view, coloured(sheet(0.1, 0.1, -0.02), {0, 1, 0}))});
  const Rig rig = two_projectors();
  const Imager& camera = rig.cameras[0];
  const cv::Mat image(480, 640, CV_8UC3, grey);
  const cv::Mat found = renderer(scene, rig).composite(0, image, posed_at_origin(scene), Composite::full);
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
      bool is_inside = true;  // whether there is no edge within a pixel
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
  EXPECT_NEAR(ring_found, ring_expected, 0.01 * ring_expected);  // pixels at edges count by their share
}

TEST_F(MaterialsTest, WhatAMaterialCutsOutGivesNoLight) {
  const Rig rig = two_projectors();
  for (const scene::Mode mode : {scene::Mode::view, scene::Mode::surface}) {
    const double z = mode == scene::Mode::view ? -0.05 : -0.0005;
    const Scene scene = scene_of(sheet(0.5, 0.4), {slot("ring", mode, ring(z, {255, 255, 255}))});
    Renderer drawing = renderer(scene, rig);
    const Vector3d p_camera(-0.3, -0.3, -1.2);
    const PosedScene posed = posed_at_origin(scene);
    const cv::Mat light = drawing.projector_image(0, posed, viewer_from(p_camera));
    int same = 0, either = 0, beside = 0;
    for (int row = 0; row < light.rows; ++row)
      for (int column = 0; column < light.cols; ++column) {
        const auto expected_at = [&](const Vector2d& px) {
          const auto p = on_sheet(*rig.projectors[0].ray(px), 0.5, 0.4, 0);
          if (!p) return false;
          if (mode == scene::Mode::surface) return is_on_ring(p->x(), p->y());
          const auto q = on_sheet(Ray{p_camera, (*p - p_camera).normalized()}, 0.2, 0.2, z);
          return q && is_on_ring(q->x(), q->y());
        };
        const bool expected = expected_at(Vector2d(column, row));
        const bool is_lit = light.at<cv::Vec3b>(row, column)[1] > 0;
        // Half of the light of a half share.
        const bool is_bright = light_of(light.at<cv::Vec3b>(row, column)[1]) > 0.2;
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

// The reference ray tracer also passes through cut-outs.
TEST_F(MaterialsTest, CutOutPartsAgreeWithARayTracer) {
  const Mesh part = ring(-0.05, {0, 0, 255});
  const Scene scene = scene_of(sheet(0.5, 0.4), {slot("ring", scene::Mode::view, part)});
  const Rig rig = two_projectors();
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].world_from_part = Pose(exp_rotation({0.4, -0.5, 0.3}), {0.02, 0.01, -0.1});
  const cv::Mat found =
      renderer(scene, rig).composite(0, cv::Mat::zeros(480, 640, CV_8UC3), posed, Composite::full);
  const sim::MeshInstance placed{&part, posed.parts[0].world_from_part};
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

}  // namespace
}  // namespace limn::projector
