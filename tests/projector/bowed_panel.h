#pragma once

// A prototype whose surface is known by a formula: a panel that is bowed like a parabola along x.
#include <cmath>

#include "scene/meshes/mesh.h"
#include "tests/support/meshes.h"

namespace limn::projector {

inline constexpr double k_panel_width = 0.5, k_panel_height = 0.36, k_panel_bow = 0.05;  // m

/// z of the panel at x.
inline double bow_at(double x) { return k_panel_bow * std::pow(2 * x / k_panel_width, 2); }

/// The panel, with texture coordinates, of so many columns; its middle is nearest to the viewer.
inline scene::Mesh bowed_panel(int columns) {
  scene::Mesh mesh = test::grid(columns, 2, [](double u, double v) {
    const double x = k_panel_width * (u - 0.5);
    return Eigen::Vector3d(x, k_panel_height * (v - 0.5), bow_at(x));
  });
  mesh.normals.clear();
  for (const auto& p : mesh.positions) {
    const float slope = static_cast<float>(8 * k_panel_bow / (k_panel_width * k_panel_width)) * p.x();
    mesh.normals.push_back(Eigen::Vector3f(slope, 0, -1).normalized());
    mesh.uvs.emplace_back(p.x() / static_cast<float>(k_panel_width) + 0.5F,
                          0.5F - p.y() / static_cast<float>(k_panel_height));
  }
  return mesh;
}

}  // namespace limn::projector
