#include "sim/reference_brdf.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>

#include "scene/meshes/tangents.h"
#include "sim/ray_scene.h"
#include "tests/support/matchers.h"

namespace limn::sim {
namespace {

using Eigen::Vector3d;

const Vector3d k_up = Vector3d::UnitZ();

SurfaceMaterial material(const Vector3d& base_bgr, double metallic, double roughness) {
  SurfaceMaterial out;
  out.base = base_bgr;
  out.metallic = metallic;
  out.roughness = roughness;
  out.emitted.setZero();
  return out;
}

Vector3d tilted(double degrees) {
  const double angle = degrees * M_PI / 180;
  return {std::sin(angle), 0, std::cos(angle)};
}

scene::RoomLight even_light(double strength) {
  scene::RoomLight room;
  room.below_rgb = room.above_rgb = Vector3d::Constant(strength);
  return room;
}

TEST(ReferenceBrdf, ALampHeadOnIsMirroredAsGgxSays) {
  scene::RoomLight room;
  room.lamps = {{k_up, Vector3d(0.3, 0.2, 0.1)}};
  // pi D V = 1 / (4 alpha^2) when light, viewing direction and normal are the same; alpha = 0.5^2.
  const Vector3d metal = shaded(material({0.2, 0.4, 0.8}, 1, 0.5), k_up, k_up, room);
  EXPECT_TRUE(test::near(metal, 4 * Vector3d(0.2 * 0.1, 0.4 * 0.2, 0.8 * 0.3), 1e-9));
  // 4 % reflected white light, over the remaining diffuse colour.
  const Vector3d gloss = shaded(material({0.2, 0.4, 0.8}, 0, 0.5), k_up, k_up, room);
  EXPECT_NEAR(gloss.x(), 0.1 * (0.96 * 0.2 + 0.04 * 4), 1e-9);
  // A lamp has a size, so smoother surfaces do not differ.
  const auto smooth = [&](double roughness) {
    return shaded(material({1, 1, 1}, 1, roughness), k_up, k_up, room);
  };
  EXPECT_TRUE(test::near(smooth(0.01), smooth(0.2), 1e-9));
}

TEST(ReferenceBrdf, InEvenLightNoMetalIsBrighterThanItAndASmoothOneIsAsBright) {
  for (const double roughness : {0.05, 0.2, 0.5, 1.0})
    for (const double degrees : {0.0, 40.0, 70.0}) {
      const Vector3d d_view = tilted(degrees);
      const double white_metal = shaded(material({1, 1, 1}, 1, roughness), k_up, d_view, even_light(0.5)).x();
      EXPECT_LT(white_metal, 0.5 * 1.005) << roughness << " " << degrees;
      if (roughness <= 0.2) {
        EXPECT_GT(white_metal, 0.5 * 0.97) << roughness << " " << degrees;
      }
    }
}

TEST(ReferenceBrdf, AnEvenPictureOfTheRoomIsEvenSoftLight) {
  scene::RoomImage image;
  image.light = cv::Mat(8, 16, CV_32FC3, cv::Scalar::all(0.25));
  const RoomImageSizes sizes(image);
  scene::RoomLight room;
  room.image_strength = 2;
  for (const auto& [metallic, roughness] : {std::pair(0.0, 0.3), {0.5, 0.6}, {1.0, 1.0}}) {
    SurfaceMaterial lacquer = material({0.2, 0.4, 0.8}, metallic, roughness);
    lacquer.coat = 1;
    lacquer.coat_roughness = 0.2;
    EXPECT_TRUE(test::near(shaded(lacquer, k_up, tilted(50), room, {}, &sizes),
                           shaded(lacquer, k_up, tilted(50), even_light(0.5)), 3e-3));
  }
  EXPECT_TRUE(
      test::near(shaded(material({1, 1, 1}, 0, 0.5), k_up, k_up, room), Vector3d::Zero().eval(), 1e-12))
      << "a scene without a picture";
}

// The reflected soft light as a sum over directions of the hemisphere, without half vectors.
Vector3d mirrored_by_rings(const SurfaceMaterial& s,
                           const Vector3d& n,
                           const Vector3d& d_view,
                           const scene::RoomLight& room) {
  const double alpha2 = std::pow(s.roughness, 4), nv = n.dot(d_view);
  const Vector3d d_u = n.unitOrthogonal(), d_v = n.cross(d_u);
  constexpr int k_rings = 500, k_steps = 600;
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < k_rings; ++i)
    for (int k = 0; k < k_steps; ++k) {
      const double nl = (i + 0.5) / k_rings, ring = std::sqrt(1 - nl * nl),
                   angle = 2 * M_PI * (k + 0.5) / k_steps;
      const Vector3d d = ring * (std::cos(angle) * d_u + std::sin(angle) * d_v) + nl * n;
      const Vector3d h = (d + d_view).normalized();
      const double peak = 1 - (1 - alpha2) * std::pow(n.dot(h), 2);
      const double masked =
          nl * std::sqrt(nv * nv + alpha2 * (1 - nv * nv)) + nv * std::sqrt(nl * nl + alpha2 * (1 - nl * nl));
      const double t = std::clamp((d.dot(room.d_up_world) + 0.3) / 0.6, 0.0, 1.0),
                   above = t * t * (3 - 2 * t);
      const Vector3d light = (1 - above) * room.below_rgb + above * room.above_rgb;
      const Vector3d fresnel = s.base + (Vector3d::Ones() - s.base) * std::pow(1 - d.dot(h), 5);
      sum += light.reverse().cwiseProduct(fresnel) *
             (nl * alpha2 / (peak * peak) / (2 * masked) * 2 / (k_rings * k_steps));
    }
  return sum;
}

TEST(ReferenceBrdf, MirroredSoftLightIsItsSumOverDirections) {
  scene::RoomLight room;
  room.below_rgb = {0.05, 0.1, 0.2};
  room.above_rgb = {0.6, 0.5, 0.4};
  double worst = 0;
  for (const double roughness : {0.25, 0.5, 0.8})
    for (const double degrees : {10.0, 45.0, 70.0}) {
      const SurfaceMaterial metal = material({0.3, 0.6, 0.9}, 1, roughness);
      room.d_up_world = Vector3d(-0.9, 0.3, 0.1).normalized();
      const Vector3d found = shaded(metal, k_up, tilted(degrees), room);
      const Vector3d expected = mirrored_by_rings(metal, k_up, tilted(degrees), room);
      worst = std::max(worst, (found - expected).cwiseAbs().maxCoeff());
    }
  EXPECT_LT(worst, 0.7 / 255);
}

TEST(ReferenceBrdf, OcclusionKeepsSoftLightAloneAndEmissionIsAdded) {
  scene::RoomLight room = even_light(0.4), lamp_alone;
  room.lamps = lamp_alone.lamps = {{tilted(30), Vector3d::Constant(0.5)}};
  SurfaceMaterial open = material({0.2, 0.4, 0.6}, 0.5, 0.4), closed = open;
  closed.occlusion = 0;
  closed.emitted = {0.1, 0.2, 0.3};
  EXPECT_TRUE(test::near(shaded(closed, k_up, tilted(-20), room),
                         shaded(open, k_up, tilted(-20), lamp_alone) + Vector3d(0.1, 0.2, 0.3), 1e-9));
}

TEST(ReferenceBrdf, AClearLayerMirrorsBesideWhatItDarkens) {
  scene::RoomLight lamp, soft;
  lamp.lamps = {{k_up, Vector3d::Constant(0.3)}};
  SurfaceMaterial coated = material({0.2, 0.4, 0.8}, 0.5, 0.6);
  coated.emitted = {0.3, 0.2, 0.1};
  SurfaceMaterial bare = coated;
  coated.coat = 0.5;
  coated.coat_roughness = 0.5;
  // Head-on, glass mirrors 4 %, and pi D V = 1 / (4 alpha^2) with alpha = 0.5^2 (as above).
  EXPECT_TRUE(test::near(shaded(coated, k_up, k_up, lamp),
                         0.98 * shaded(bare, k_up, k_up, lamp) + Vector3d::Constant(0.02 * 4 * 0.3), 1e-9));
  // Soft light is that of a white metal of the layer's roughness and normal, at the share of its own angle.
  soft.below_rgb = {0.05, 0.1, 0.2};
  soft.above_rgb = {0.6, 0.5, 0.4};
  coated.occlusion = bare.occlusion = 0.7;
  const Vector3d d_view = tilted(60), n_coat = tilted(10);
  const double share = 0.5 * (0.04 + 0.96 * std::pow(1 - n_coat.dot(d_view), 5));
  const Vector3d mirrored = 0.7 * mirrored_by_rings(material({1, 1, 1}, 1, 0.5), n_coat, d_view, soft);
  EXPECT_TRUE(test::near(shaded(coated, k_up, d_view, soft, n_coat),
                         (1 - share) * shaded(bare, k_up, d_view, soft) + share * mirrored, 1e-3));
}

TEST(ReferenceBrdf, TexturesLieInTheCoordinatesOfTheirSet) {
  scene::Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.uvs = {{0, 0}, {1, 0}, {0, 1}};
  mesh.second_uvs = {{0.75F, 0.25F}, {0.75F, 0.25F}, {0.75F, 0.25F}};
  mesh.triangles = {{0, 1, 2}};
  mesh.triangle_materials = {0};
  const auto halves = [](const cv::Vec3b& left, const cv::Vec3b& right) {
    cv::Mat image(2, 2, CV_8UC3);
    image.col(0).setTo(left);
    image.col(1).setTo(right);
    return image;
  };
  scene::Material& material = mesh.materials[0];
  material.coat = {.factor = 1, .roughness = 1};
  material.coat.factor_map = {halves({0, 0, 51}, {0, 0, 204}), "", true};
  material.coat.roughness_map = {halves({0, 51, 0}, {0, 204, 0}), "", false};
  material.maps.occlusion = {halves({0, 0, 51}, {0, 0, 204}), "", true};
  const std::array placed = {MeshInstance{&mesh, {}}};
  const RayScene rays(placed);
  const Hit hit = rays.first_hit({{0.25, 0.25, 1}, {0, 0, -1}});
  const SurfaceMaterial found =
      surface_material(mesh, hit.triangle, rays.uv(hit), rays.colour(hit), rays.second_uv(hit));
  EXPECT_NEAR(found.coat, 0.8, 1e-6);
  EXPECT_NEAR(found.coat_roughness, 0.2, 1e-6);
  EXPECT_NEAR(found.occlusion, 0.8, 1e-6);
}

TEST(ReferenceBrdf, TexturesAndFactorsAreMultipliedAndRepeat) {
  scene::Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.uvs = {{0, 0}, {1, 0}, {0, 1}};
  mesh.triangles = {{0, 1, 2}};
  mesh.triangle_materials = {0};
  const auto plain = [](const cv::Scalar& bgr) { return scene::Texture{cv::Mat(2, 2, CV_8UC3, bgr), ""}; };
  scene::Material& material = mesh.materials[0];
  material.metallic = 0.5F;
  material.emitted = {1, 0.5F, 0};
  material.maps = {.metallic_roughness = plain({51, 102, 0}),
                   .normals = plain({255, 0, 255}),
                   .occlusion = plain({0, 0, 51}),
                   .emission = plain({255, 255, 255}),
                   .normal_scale = 0.25F,
                   .occlusion_strength = 0.5F};
  material.maps.metallic_roughness.image.at<cv::Vec3b>(0, 1) = {255, 255, 0};  // top right
  scene::add_tangents(&mesh);
  const SurfaceMaterial found = surface_material(mesh, 0, {0.25F, 0.25F});
  EXPECT_NEAR(found.metallic, 0.5 * 0.2, 1e-6);
  EXPECT_NEAR(found.roughness, 0.4, 1e-6);
  EXPECT_NEAR(found.occlusion, 1 - 0.5 * 0.8, 1e-6);
  EXPECT_TRUE(test::near(found.emitted, Vector3d(0, 0.5, 1), 1e-6));
  EXPECT_TRUE(test::near(found.along, Vector3d(0.25, -0.25, 1), 1e-6));
  EXPECT_FALSE(found.is_diffuse);
  for (const Eigen::Vector2f& uv : {Eigen::Vector2f(0.75F, 0.75F), {1.75F, -0.25F}}) {
    EXPECT_NEAR(surface_material(mesh, 0, uv).roughness, 1, 1e-6);
  }
  // Half way between the texture and its repetition.
  EXPECT_NEAR(surface_material(mesh, 0, {0, 0.75F}).roughness, 0.7, 1e-6);
}

// A triangle whose corners are red, green and blue; its material lets half of the red through.
TEST(SurfaceMaterial, ColoursOfVerticesMultiplyTheBaseColour) {
  scene::Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.colours = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 1, 2}};
  mesh.triangle_materials = {0};
  mesh.materials[0].base_colour = {0.5F, 1, 1};
  const std::array placed = {MeshInstance{&mesh, {}}};
  const RayScene rays(placed);
  const Hit hit = rays.first_hit({{0.25, 0.25, 1}, {0, 0, -1}});
  ASSERT_EQ(hit.triangle, 0);
  const SurfaceMaterial found = surface_material(mesh, hit.triangle, rays.uv(hit), rays.colour(hit));
  EXPECT_TRUE(test::near(found.base, Vector3d(0.25, 0.25, 0.5 * 0.5), 1e-6));  // BGR
}

}  // namespace
}  // namespace limn::sim
