#pragma once

// A room of plain sheets, for which the correct image is known by a formula, and a renderer for it.
#include <cmath>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/rig.h"
#include "projector/renderer.h"
#include "scene/posed_scene.h"
#include "tests/projector/gl_test.h"
#include "tests/support/meshes.h"

namespace limn::projector {

using Eigen::Vector2d;
using Eigen::Vector3d;
using scene::Mesh;
using scene::PosedScene;
using scene::Scene;
using scene::Slot;
using test::grid;

// The room: the prototype's front faces -z, where projectors, viewer and camera stand.
inline const Vector3d k_up(0, -1, 0);

// A rectangle in a plane of constant z; its middle is on the z axis.
inline Mesh sheet(double width, double height, double z = 0, int cells = 7) {
  return test::sheet(width, height, z, cells);
}

inline Mesh coloured(Mesh mesh, const Eigen::Vector3f& colour, bool unlit = true) {
  mesh.materials[0].base_colour = colour;
  mesh.materials[0].unlit = unlit;
  return mesh;
}

inline Imager imager_at(
    const std::string& name, int width, int height, const Vector3d& p_viewpoint, std::vector<double> lens) {
  Imager imager{name, width, height, {}, looking_at(p_viewpoint, {0, 0, 0}, k_up)};
  imager.lens = Lens::create("LENSMODEL_OPENCV4", std::move(lens)).value();
  return imager;
}

inline Imager projector_left() {
  return imager_at("projector0", 640, 400, {-0.35, -0.1, -1.1},
                   {900, 900, 325, 190, -0.15, 0.1, 0.002, -0.001});
}
inline Imager projector_right() {
  return imager_at("projector1", 640, 400, {0.35, -0.05, -1.15}, {950, 950, 310, 205, -0.1, 0.05, 0, 0.001});
}
inline Imager camera() {
  return imager_at("camera0", 640, 480, {0.05, -0.2, -1.3}, {1000, 1000, 320, 240, -0.2, 0.1, 0.001, 0.001});
}
inline Imager viewer_from(const Vector3d& p_viewpoint) {
  return viewer_imager(looking_at(p_viewpoint, {0, 0, 0}, k_up).inverse(), 640, 480, 35);
}

inline Rig two_projectors() {
  Rig rig;
  rig.cameras = {camera()};
  rig.projectors = {projector_left(), projector_right()};
  return rig;
}

inline Slot slot(const std::string& name, scene::Mode mode, Mesh mesh) {
  Slot out;
  out.name = name;
  out.mode = mode;
  out.variants.push_back({"a", std::move(mesh)});
  return out;
}

inline Scene scene_of(Mesh prototype, std::vector<Slot> slots) {
  Scene scene;
  scene.prototype = scene::Prototype{std::move(prototype), {}, 0.8, {}};
  scene.slots = std::move(slots);
  return scene;
}

inline PosedScene posed_at_origin(const Scene& scene) {
  PosedScene posed;
  if (scene.prototype) posed.world_from_prototype = Pose();
  for (const Slot& slot : scene.slots) posed.parts.push_back({slot.name, "a", Pose()});
  return posed;
}

// The light of an 8-bit display value, gamma 2.2.
inline double light_of(std::uint8_t value) { return std::pow(value / 255.0, 2.2); }

// Where the ray hits the rectangle of a sheet() at z; nullopt if it misses.
inline std::optional<Vector3d> on_sheet(const Ray& ray, double width, double height, double z) {
  const double t = (z - ray.p_origin.z()) / ray.d.z();
  const Vector3d p = ray.p_origin + t * ray.d;
  if (!(t > 0) || std::abs(p.x()) > width / 2 || std::abs(p.y()) > height / 2) return std::nullopt;
  return p;
}

// Mean of f over the eight sample positions in a pixel that the renderer uses.
inline double pixel_mean(int column, int row, const std::function<double(const Vector2d&)>& f) {
  const double first = f(Vector2d(column - 0.5, row - 0.5));
  if (first == f(Vector2d(column + 0.5, row - 0.5)) && first == f(Vector2d(column - 0.5, row + 0.5)) &&
      first == f(Vector2d(column + 0.5, row + 0.5))) {
    return first;  // no corner of a sheet lies inside a pixel
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

}  // namespace limn::projector
