// Clear layers and second texture coordinates, against the ray tracer.
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "scene/meshes/tangents.h"
#include "tests/projector/judged_image.h"
#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

using CoatsTest = RendererTest;

constexpr double k_side = 0.24, k_bow = 0.05;  // m

// A texture from a function that gives red, green and blue (0 to 1) at u, v (up).
scene::Texture painted(const std::function<Vector3d(double, double)>& rgb_at, bool in_second_uvs) {
  constexpr int k_texels = 64;  // each covers more than two pixels
  cv::Mat image(k_texels, k_texels, CV_8UC3);
  for (int row = 0; row < k_texels; ++row)
    for (int column = 0; column < k_texels; ++column) {
      const Vector3d rgb = rgb_at((column + 0.5) / k_texels, 1 - (row + 0.5) / k_texels);
      for (int c = 0; c < 3; ++c)
        image.at<cv::Vec3b>(row, column)[2 - c] = cv::saturate_cast<std::uint8_t>(255 * rgb[c]);
    }
  return {image, "", in_second_uvs};
}

double wave(double turns) { return std::sin(2 * M_PI * turns); }

scene::Texture relief(double waves, double slope, bool in_second_uvs) {
  return painted(
      [=](double u, double v) {
        const Vector3d n = Vector3d(slope * wave(waves * u), slope * wave(waves * v), 1).normalized();
        return Vector3d(0.5 * (n + Vector3d::Ones()));
      },
      in_second_uvs);
}

// A bowed sheet in front of the prototype, or lying on its flat middle (bow 0). Its second coordinates are
// the first ones, turned and moved.
Mesh panel(double z, double bow) {
  Mesh mesh = test::grid(32, 2, [=](double u, double v) {
    const double x = k_side * (u - 0.5);
    return Vector3d(x, k_side * (v - 0.5), z + bow * std::pow(2 * x / k_side, 2));
  });
  mesh.normals.clear();
  for (const auto& p : mesh.positions) {
    const float slope = static_cast<float>(8 * bow / (k_side * k_side)) * p.x();
    mesh.normals.push_back(Eigen::Vector3f(slope, 0, -1).normalized());
    mesh.uvs.emplace_back(p.x() / static_cast<float>(k_side) + 0.5F,
                          0.5F - p.y() / static_cast<float>(k_side));
    mesh.second_uvs.emplace_back(mesh.uvs.back().y() + 0.25F, 1 - mesh.uvs.back().x());
  }
  return mesh;
}

// A lacquer all over which a second relief runs, on a base with a relief of its own.
Mesh lacquered(double z, double bow) {
  Mesh mesh = panel(z, bow);
  scene::Material& material = mesh.materials[0];
  material.base_colour = {0.5F, 0.08F, 0.05F};
  material.metallic = 0.8F;
  material.roughness = 0.6F;
  material.emitted = {0.6F, 0.6F, 0.6F};
  material.maps.metallic_roughness =
      painted([](double u, double) { return Vector3d(0.2, 0.7 + 0.3 * u, 0.5); }, false);
  material.maps.occlusion = painted([](double u, double) { return Vector3d(0.4 + 0.6 * u, 0, 0); }, true);
  material.maps.normals = relief(2, 0.3, false);
  material.maps.emission =
      painted([](double u, double) { return Vector3d::Constant(0.3 + 0.3 * wave(u)).eval(); }, true);
  material.coat.factor = 0.9F;
  material.coat.roughness = 0.8F;
  material.coat.factor_map =
      painted([](double u, double) { return Vector3d(0.6 + 0.4 * wave(u), 0, 0); }, true);
  material.coat.roughness_map =
      painted([](double, double v) { return Vector3d(0, 0.3 + 0.5 * v, 0); }, false);
  material.coat.normals = relief(3, 0.2, false);
  material.coat.normal_scale = 0.7F;
  scene::add_tangents(&mesh);
  return mesh;
}

JudgedRoom room_with(scene::Mode mode, Mesh part) {
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  Scene scene = scene_of(sheet(0.5, 0.4), {slot("panel", mode, std::move(part))});
  scene.light = scene::RoomLight{
      k_up, {0.05, 0.08, 0.1}, {0.3, 0.28, 0.25}, {{Vector3d(0.2, -0.5, -1).normalized(), {0.5, 0.45, 0.4}}}};
  return judged_room(std::move(rig), std::move(scene));
}

TEST_F(CoatsTest, LightAndCompositesOfAClearLayerAreThoseOfTheRayTracer) {
  for (const scene::Mode mode : {scene::Mode::view, scene::Mode::surface}) {
    const bool on_surface = mode == scene::Mode::surface;
    SCOPED_TRACE(on_surface ? "surface" : "view");
    const JudgedRoom room = room_with(mode, on_surface ? lacquered(-0.0005, 0) : lacquered(-0.08, k_bow));
    Renderer drawing = renderer(room.scene, room.rig);
    expect_agreement(&drawing, room, 15000, 15000);
  }
}

// A mesh without second coordinates shows one colour of what lies in them, and no channel of another texture.
TEST_F(CoatsTest, ATextureInCoordinatesThatAreMissingIsPlain) {
  Mesh part = lacquered(-0.08, k_bow);
  part.second_uvs.clear();
  const JudgedRoom room = room_with(scene::Mode::view, std::move(part));
  Renderer drawing = renderer(room.scene, room.rig);
  const sim::ReferenceRenderer judge(room.world, room.posed, room.viewer);
  const auto seen =
      agree(composite_over_black(&drawing, room), judge.parts_image(room.rig.cameras[0]), 0, 15000);
  EXPECT_TRUE(seen) << seen.message();
}

// A map and two of its colours that are seen to differ.
struct TwoColours {
  std::string name;
  std::function<scene::Texture&(scene::Material*)> map;
  Vector3d left, right;
};

std::vector<TwoColours> all_maps() {
  using scene::Material, scene::Texture;
  const Vector3d leaning = 0.5 * (Vector3d(0.5, 0.3, 1).normalized() + Vector3d::Ones()),
                 upright(0.5, 0.5, 1);
  return {{"coat", [](Material* m) -> Texture& { return m->coat.factor_map; }, {0, 1, 1}, {1, 0, 0}},
          {"coat roughness",
           [](Material* m) -> Texture& { return m->coat.roughness_map; },
           {1, 0.1, 1},
           {0, 1, 0}},
          {"coat normals", [](Material* m) -> Texture& { return m->coat.normals; }, leaning, upright},
          {"occlusion", [](Material* m) -> Texture& { return m->maps.occlusion; }, {0, 1, 1}, {1, 0, 0}},
          {"emission", [](Material* m) -> Texture& { return m->maps.emission; }, {0, 0, 0}, {1, 1, 1}},
          {"normals", [](Material* m) -> Texture& { return m->maps.normals; }, leaning, upright},
          {"metal and roughness",
           [](Material* m) -> Texture& { return m->maps.metallic_roughness; },
           {0, 0.4, 0},
           {1, 1, 1}}};
}

// A map with one colour on its left half and another one on its right half is seen like the plain map of the
// first one where its own coordinates are on the left, and like that of the second one elsewhere.
TEST_F(CoatsTest, EveryMapIsSeenInItsOwnCoordinates) {
  Mesh bare = lacquered(-0.08, k_bow);
  scene::Material& material = bare.materials[0];
  material.maps = {};
  material.coat = {.factor = 0.9F, .roughness = 0.8F};
  material.emitted = {0.03F, 0.03F, 0.03F};
  JudgedRoom room = room_with(scene::Mode::view, bare);
  std::vector<scene::Variant>& variants = room.scene.slots[0].variants;
  const auto halves = [](const Vector3d& left, const Vector3d& right, bool in_second) {
    return painted([&](double u, double) { return u < 0.5 ? left : right; }, in_second);
  };
  const char* const sets[] = {"first", "second"};
  for (const bool in_second : {false, true}) {
    Mesh mask = bare;  // white on the right
    mask.materials = {scene::Material()};
    mask.materials[0].base_colour = {1, 1, 1};
    mask.materials[0].unlit = true;
    mask.materials[0].texture = halves({0, 0, 0}, {1, 1, 1}, false).image;
    if (in_second) mask.uvs = mask.second_uvs;
    variants.push_back({sets[in_second], mask});
    for (const TwoColours& one : all_maps()) {
      Mesh mesh = bare;
      scene::Texture& map = one.map(&mesh.materials[0]);
      map = halves(one.left, one.right, in_second);
      variants.push_back({one.name + sets[in_second], mesh});
      map = halves(one.left, one.left, false);
      if (!in_second) variants.push_back({one.name + " left", mesh});
      map = halves(one.right, one.right, false);
      if (!in_second) variants.push_back({one.name + " right", mesh});
    }
  }
  Renderer drawing = renderer(room.scene, room.rig);
  const auto composite = [&](const std::string& variant) {
    room.posed.parts[0].variant = variant;
    return composite_over_black(&drawing, room);
  };
  // The part without its rim, left and right, and without what is near the middle of the map.
  cv::Mat on_part;
  cv::cvtColor(composite("emission right"), on_part, cv::COLOR_BGR2GRAY);
  cv::erode(on_part > 0, on_part, cv::Mat(), {-1, -1}, 5);
  for (const char* set : sets) {
    cv::Mat white, left, right;
    cv::cvtColor(composite(set), white, cv::COLOR_BGR2GRAY);
    cv::erode(white < 1, left, cv::Mat(), {-1, -1}, 5);
    cv::erode(white > 254, right, cv::Mat(), {-1, -1}, 5);
    left &= on_part;
    ASSERT_GT(cv::countNonZero(left), 5000);
    ASSERT_GT(cv::countNonZero(right), 5000);
    for (const TwoColours& one : all_maps()) {
      const cv::Mat found = composite(one.name + set);
      for (const bool is_right : {false, true}) {
        const cv::Mat wanted = composite(one.name + (is_right ? " right" : " left"));
        // Rounding changes one level. A clear layer mirrors little.
        EXPECT_LE(cv::norm(found, wanted, cv::NORM_INF, is_right ? right : left), 1)
            << one.name << ", " << set;
        EXPECT_GT(cv::norm(found, wanted, cv::NORM_INF, is_right ? left : right), 3)
            << one.name << ", " << set;
      }
    }
  }
}

}  // namespace
}  // namespace limn::projector
