#include "sim/finish_panel.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>
#include <opencv2/core.hpp>

#include "core/photometric_response.h"
#include "scene/meshes/glb.h"
#include "scene/meshes/tangents.h"

namespace limn::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_width = 0.5, k_height = 0.34, k_bow = 0.06;  // m
constexpr double k_plate_lift = 0.0004;  // m; on the surface, but clear of its triangles
constexpr int k_texels = 64;             // texels for each side; each texel covers at least two camera pixels

// Height of the curved panel, m.
double bowed(double x) { return -k_bow * std::pow(2 * x / k_width, 2); }

// A sheet over u, v from 0 to 1, with normals and uvs.
scene::Mesh sheet(int columns, int rows, const std::function<Vector3d(double, double)>& at) {
  scene::Mesh mesh;
  constexpr double k_step = 1e-4;
  for (int r = 0; r <= rows; ++r)
    for (int c = 0; c <= columns; ++c) {
      const double u = static_cast<double>(c) / columns, v = static_cast<double>(r) / rows;
      const Vector3d n = (at(u + k_step, v) - at(u - k_step, v)).cross(at(u, v + k_step) - at(u, v - k_step));
      mesh.positions.push_back((at(u, v) * 1e6).array().round().matrix().cast<float>() /
                               1e6F);  // rounded, so that the files are reproducible
      mesh.normals.push_back(n.normalized().cast<float>());
      mesh.uvs.push_back(Vector2d(u, v).cast<float>());
    }
  const auto index = [&](int c, int r) { return static_cast<std::uint32_t>(r * (columns + 1) + c); };
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      mesh.triangles.push_back({index(c, r), index(c + 1, r), index(c + 1, r + 1)});
      mesh.triangles.push_back({index(c, r), index(c + 1, r + 1), index(c, r + 1)});
    }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
}

// A texture from a function that gives red, green and blue (0 to 1) at u, v.
scene::Texture painted(const std::function<Vector3d(const Vector2d&)>& rgb_at) {
  cv::Mat image(k_texels, k_texels, CV_8UC3);
  for (int row = 0; row < k_texels; ++row)
    for (int column = 0; column < k_texels; ++column) {
      const Vector3d rgb = rgb_at({(column + 0.5) / k_texels, 1 - (row + 0.5) / k_texels});
      for (int c = 0; c < 3; ++c)
        image.at<cv::Vec3b>(row, column)[2 - c] = cv::saturate_cast<std::uint8_t>(255 * rgb[c]);
    }
  return {image, ""};
}

// The normal map of a relief, given by its slopes along u and v.
scene::Texture relief(const std::function<Vector2d(const Vector2d&)>& slopes_at) {
  return painted([&](const Vector2d& uv) {
    const Vector2d slopes = slopes_at(uv);
    const Vector3d n = Vector3d(-slopes.x(), -slopes.y(), 1).normalized();
    return Vector3d(0.5 * (n + Vector3d::Ones()));
  });
}

double wave(double turns) { return std::sin(2 * std::numbers::pi * turns); }

// A smooth step from 0 to 1 over about 8 texels around `at`.
double step(double value, double at) { return 1 / (1 + std::exp((at - value) * k_texels)); }

// A hammered cushion: a gold oval with lacquer around it and a glowing line.
scene::Mesh emblem() {
  scene::Mesh mesh = sheet(24, 16, [](double u, double v) {
    const auto fall = [](double t) { return 1 - std::pow(std::abs(2 * t - 1), 4); };
    return Vector3d(0.14 * (u - 0.5), 0.09 * (v - 0.5), 0.016 * fall(u) * fall(v));
  });
  const auto radius = [](const Vector2d& uv) { return (uv - Vector2d(0.5, 0.5)).norm(); };
  scene::Material& material = mesh.materials[0];
  material.base_colour = {0.85F, 0.6F, 0.25F};
  material.metallic = material.roughness = 1;
  material.emitted = {0.5F, 0.5F, 0.5F};
  material.maps.metallic_roughness = material.maps.occlusion = painted([&](const Vector2d& uv) {
    const double open = 1 - 0.7 * step(radius(uv), 0.42), metal = step(0.3, radius(uv));
    return Vector3d(open, 0.45 + 0.2 * wave(2 * uv.x()), metal);
  });
  material.maps.normals = relief([](const Vector2d& uv) {
    return Vector2d(0.3 * wave(4 * uv.x()) * wave(3 * uv.y()),
                    0.3 * wave(4 * uv.x() + 0.25) * wave(3 * uv.y()));
  });
  material.maps.normal_scale = 0.8F;
  material.maps.occlusion_strength = 0.9F;
  material.maps.emission = painted([&](const Vector2d& uv) {
    const double glow = step(radius(uv), 0.33) * step(0.39, radius(uv));
    return Vector3d(srgb_from_linear(0.9 * glow), srgb_from_linear(0.3 * glow), srgb_from_linear(0.1 * glow));
  });
  return mesh;
}

// A plate of fluted steel that lies on the panel.
scene::Mesh plate() {
  scene::Mesh mesh = sheet(24, 2, [](double u, double v) {
    const double x = 0.2 * (u - 0.5), y = 0.06 * (v - 0.5);
    const Vector3d n = Vector3d(8 * k_bow * x / (k_width * k_width), 0, 1).normalized();
    return Vector3d(Vector3d(x, y, bowed(x)) + k_plate_lift * n);
  });
  scene::Material& material = mesh.materials[0];
  material.base_colour = {0.7F, 0.72F, 0.75F};
  material.maps.metallic_roughness =
      painted([](const Vector2d& uv) { return Vector3d(1, 0.4 + 0.25 * uv.x(), step(uv.y(), 0.3)); });
  material.metallic = material.roughness = 1;
  material.maps.normals = relief([](const Vector2d& uv) { return Vector2d(0.25 * wave(5 * uv.x()), 0); });
  return mesh;
}

std::string file_of(scene::Mesh mesh) {
  if (!mesh.materials[0].maps.is_none()) scene::add_tangents(&mesh);
  const scene::GlbNode placed{"", &mesh, Pose()};
  return scene::encode_glb(std::span(&placed, 1));
}

}  // namespace

std::map<std::string, std::string> finish_panel_files() {
  const scene::Mesh panel = sheet(48, 4, [](double u, double v) {
    return Vector3d(k_width * (u - 0.5), k_height * (v - 0.5), bowed(k_width * (u - 0.5)));
  });
  return {{"panel.glb", file_of(panel)}, {"emblem.glb", file_of(emblem())}, {"plate.glb", file_of(plate())}};
}

}  // namespace limn::sim
