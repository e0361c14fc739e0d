#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "core/pose.h"
#include "scene/meshes/mesh.h"
#include "scene/meshes/scan_surface.h"

namespace limn::test {

/// A free-form panel of 0.3 x 0.2 m that faces +z, and scans of it whose truth is known.
constexpr double k_panel_width = 0.3, k_panel_height = 0.2;

/// Height of the panel at x, y (m).
using PanelShape = std::function<double(double x, double y)>;

inline double shaped(double x, double y) {
  return 0.02 * std::cos(7 * x + 0.4) + 0.012 * std::sin(16 * y + 5 * x) +
         0.004 * std::tanh((y - 0.3 * x) / 0.01);
}
inline double flat(double, double) { return 0; }

/// A round bump on the panel (height > 0) or a dent (< 0), with slopes that end smoothly.
struct Bump {
  double x = 0, y = 0, radius = 0, height = 0;
};
inline double height_of(const std::vector<Bump>& bumps, double x, double y) {
  double sum = 0;
  for (const Bump& b : bumps) {
    const double share = 1 - (std::pow(x - b.x, 2) + std::pow(y - b.y, 2)) / (b.radius * b.radius);
    if (share > 0) sum += b.height * share * share;
  }
  return sum;
}

/// The panel's point and unit normal at x, y.
struct PanelPoint {
  Eigen::Vector3d p, n;
};
inline PanelPoint panel_point(const PanelShape& shape, double x, double y) {
  constexpr double k_step = 1e-5;
  const double dx = (shape(x + k_step, y) - shape(x - k_step, y)) / (2 * k_step),
               dy = (shape(x, y + k_step) - shape(x, y - k_step)) / (2 * k_step);
  return {{x, y, shape(x, y)}, Eigen::Vector3d(-dx, -dy, 1).normalized()};
}

/// Its CAD: `columns` x `rows` cells of two triangles.
inline scene::Mesh panel_mesh(const PanelShape& shape, int columns, int rows) {
  scene::Mesh mesh;
  for (int r = 0; r <= rows; ++r)
    for (int c = 0; c <= columns; ++c) {
      const PanelPoint at = panel_point(shape, k_panel_width * (1.0 * c / columns - 0.5),
                                        k_panel_height * (1.0 * r / rows - 0.5));
      mesh.positions.push_back(at.p.cast<float>());
      mesh.normals.push_back(at.n.cast<float>());
      if (c == columns || r == rows) continue;
      const auto i = static_cast<std::uint32_t>(r * (columns + 1) + c),
                 above = i + static_cast<std::uint32_t>(columns) + 1;
      mesh.triangles.push_back({i, i + 1, above});
      mesh.triangles.push_back({i + 1, above + 1, above});
    }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
}

struct PanelScan {
  double spacing_m = 1.5e-3;
  double stddev_m = 0.05e-3;         ///< The noise along the normal.
  double stated_stddev_m = 0.05e-3;  ///< What the scan says; 0: nothing.
  Pose world_from_panel = {};
  /// Moves a point as something in front of it does (a hand); unchanged: the panel.
  std::function<Eigen::Vector3d(const Eigen::Vector3d&)> hidden_by = {};
};

/// Noise of standard deviation 1 that neighbours share, because a scanner smooths: white noise after two
/// boxes of 3 x 3.
inline std::vector<double> scanner_noise(int columns, int rows, std::mt19937_64& rng) {
  constexpr std::array k_weights = {1.0, 2.0, 3.0, 2.0, 1.0};
  constexpr double k_norm = 19;  // the sum of their squares
  std::normal_distribution<double> normal;
  const int wide = columns + 4, high = rows + 4;
  std::vector<double> white(static_cast<std::size_t>(wide * high)), noise;
  for (double& value : white) value = normal(rng);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      double sum = 0;
      for (int y = 0; y < 5; ++y)
        for (int x = 0; x < 5; ++x)
          sum += k_weights[static_cast<std::size_t>(x)] * k_weights[static_cast<std::size_t>(y)] *
                 white[static_cast<std::size_t>((r + y) * wide + c + x)];
      noise.push_back(sum / k_norm);
    }
  return noise;
}

/// A scan of the panel with bumps along its normals. Points that something hides are its points; no triangle
/// joins points that are 4 mm apart in z.
inline scene::ScanSurface scan_of_panel(const PanelShape& shape,
                                        const std::vector<Bump>& bumps,
                                        const PanelScan& how,
                                        std::mt19937_64& rng) {
  const int columns = static_cast<int>(k_panel_width / how.spacing_m),
            rows = static_cast<int>(k_panel_height / how.spacing_m);
  const std::vector<double> noise = scanner_noise(columns + 1, rows + 1, rng);
  scene::ScanSurface scan;
  std::vector<double> heights;
  for (int r = 0; r <= rows; ++r)
    for (int c = 0; c <= columns; ++c) {
      // Half a cell beside the CAD's points, so that none of them coincide.
      const double x = how.spacing_m * (c + 0.37) - k_panel_width / 2,
                   y = how.spacing_m * (r + 0.21) - k_panel_height / 2;
      const PanelPoint at = panel_point(shape, x, y);
      Eigen::Vector3d p = at.p + (height_of(bumps, x, y) + how.stddev_m * noise[heights.size()]) * at.n;
      if (how.hidden_by) p = how.hidden_by(p);
      heights.push_back(p.z());
      scan.positions.push_back((how.world_from_panel * p).cast<float>());
      if (how.stated_stddev_m > 0) scan.stddevs.push_back(static_cast<float>(how.stated_stddev_m));
    }
  const auto add = [&](std::size_t a, std::size_t b, std::size_t c) {
    const double low = std::min({heights[a], heights[b], heights[c]}),
                 high = std::max({heights[a], heights[b], heights[c]});
    if (high - low < 4e-3)
      scan.triangles.push_back(
          {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b), static_cast<std::uint32_t>(c)});
  };
  const auto width = static_cast<std::size_t>(columns) + 1;
  for (std::size_t r = 0; r < static_cast<std::size_t>(rows); ++r)
    for (std::size_t c = 0; c + 1 < width; ++c) {
      const std::size_t i = r * width + c;
      add(i, i + 1, i + width);
      add(i + 1, i + width + 1, i + width);
    }
  scan.normals = scene::normals_from_triangles(scan);
  return scan;
}

}  // namespace limn::test
