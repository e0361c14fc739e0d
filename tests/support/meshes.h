#pragma once

#include <cstdint>
#include <functional>

#include "scene/meshes/mesh.h"

namespace limn::test {

/// A surface of `columns` x `rows` cells with two triangles each. at(u, v), both from 0 to 1, says where its
/// points are (m); all normals are -z.
inline scene::Mesh grid(int columns, int rows, const std::function<Eigen::Vector3d(double, double)>& at) {
  scene::Mesh mesh;
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

/// A rectangle of cells x cells in the plane z, seen from -z; its middle is on the z axis (m).
inline scene::Mesh sheet(double width, double height, double z, int cells) {
  return grid(cells, cells,
              [=](double u, double v) { return Eigen::Vector3d((u - 0.5) * width, (v - 0.5) * height, z); });
}

/// A sheet of two triangles over which a texture is stretched.
inline scene::Mesh textured_sheet(double width, double height, double z) {
  scene::Mesh mesh = sheet(width, height, z, 1);
  mesh.uvs = {{0, 1}, {1, 1}, {0, 0}, {1, 0}};
  return mesh;
}

}  // namespace limn::test
