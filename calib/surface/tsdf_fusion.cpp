#include "calib/surface/tsdf_fusion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <unordered_map>
#include <vector>

#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double k_same_turn = 0.5;   // cosine of 60 degrees: the two sides of a thin object differ by more
constexpr double k_agree_sigmas = 5;  // views that differ by more measured different surfaces
constexpr double k_agree_m = 1e-3;    // if they also differ by more than a usable rig's cameras do
constexpr double k_truncation = 3;    // voxels: larger signed distances belong to another surface

// A grid node's position as one number; 21 bits for each axis are 2 million voxels.
std::uint64_t key_of(const Vector3i& at) {
  constexpr std::int64_t k_middle = 1 << 20;
  const auto part = [](int i) { return static_cast<std::uint64_t>(i + k_middle) & 0x1FFFFF; };
  return part(at.x()) << 42 | part(at.y()) << 21 | part(at.z());
}

Vector3i place_of(std::uint64_t key) {
  constexpr int k_middle = 1 << 20;
  const auto part = [&](int shift) { return static_cast<int>(key >> shift & 0x1FFFFF) - k_middle; };
  return {part(42), part(21), part(0)};
}

void make_unique(std::vector<std::uint64_t>* keys) {
  std::sort(keys->begin(), keys->end());
  keys->erase(std::unique(keys->begin(), keys->end()), keys->end());
}

// Cells that contain points, and their neighbours by faces: a surface between points is in one of them.
std::vector<std::uint64_t> cells_near(std::span<const RangeView> views, double voxel) {
  std::vector<std::uint64_t> cells;
  for (const RangeView& view : views)
    for (int y = 0; y < view.range.rows; ++y)
      for (int x = 0; x < view.range.cols; ++x)
        if (view.has(x, y))
          cells.push_back(key_of((view.p_world(x, y) / voxel).array().floor().cast<int>().matrix()));
  make_unique(&cells);
  const std::size_t own = cells.size();
  for (std::size_t i = 0; i < own; ++i)
    for (int axis = 0; axis < 3; ++axis)
      for (const int step : {-1, 1})
        cells.push_back(key_of(place_of(cells[i]) + step * Vector3i::Unit(axis)));
  make_unique(&cells);
  return cells;
}

Vector3i corner(int i) { return {i & 1, i >> 1 & 1, i >> 2 & 1}; }

// Signed distances at the corners of cells.
struct Grid {
  double voxel = 0;
  std::unordered_map<std::uint64_t, std::uint32_t> number;  // index of a node
  std::vector<std::uint64_t> nodes;
  std::vector<float> distance;  // positive outside; NaN unknown
};

Grid distances_at(const std::vector<std::uint64_t>& cells, std::span<const RangeView> views, double voxel) {
  Grid grid;
  grid.voxel = voxel;
  grid.number.reserve(cells.size() * 2);
  for (const std::uint64_t cell : cells)
    for (int i = 0; i < 8; ++i) {
      const std::uint64_t key = key_of(place_of(cell) + corner(i));
      if (grid.number.try_emplace(key, static_cast<std::uint32_t>(grid.nodes.size())).second)
        grid.nodes.push_back(key);
    }
  grid.distance.assign(grid.nodes.size(), std::numeric_limits<float>::quiet_NaN());
  cv::parallel_for_(cv::Range(0, static_cast<int>(grid.nodes.size())), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const Vector3d p = place_of(grid.nodes[at]).cast<double>() * voxel;
      if (const auto seen = surface_sample(views, p, k_truncation * voxel))
        grid.distance[at] = static_cast<float>(-seen->offset);
    }
  });
  return grid;
}

// The mean of the points where the surface crosses a cell's edges; nullopt where it does not cross the cell
// or a corner is unknown.
std::optional<Vector3d> vertex_in(const Grid& grid, const Vector3i& cell) {
  std::array<double, 8> d{};
  int inside = 0;
  for (int i = 0; i < 8; ++i) {
    const auto node = grid.number.find(key_of(cell + corner(i)));
    if (node == grid.number.end() || std::isnan(grid.distance[node->second])) return std::nullopt;
    d[static_cast<std::size_t>(i)] = grid.distance[node->second];
    inside += d[static_cast<std::size_t>(i)] < 0;
  }
  if (inside == 0 || inside == 8) return std::nullopt;
  Vector3d sum = Vector3d::Zero();
  int crossings = 0;
  for (int i = 0; i < 8; ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const int j = i | 1 << axis;
      const double a = d[static_cast<std::size_t>(i)], b = d[static_cast<std::size_t>(j)];
      if (i == j || (a < 0) == (b < 0)) continue;
      sum += corner(i).cast<double>() + a / (a - b) * (corner(j) - corner(i)).cast<double>();
      ++crossings;
    }
  return (cell.cast<double>() + sum / crossings) * grid.voxel;
}

using CellVertices = std::unordered_map<std::uint64_t, std::uint32_t>;

// Adds the quadrilateral around a grid edge whose ends are on different sides, as two triangles along the
// shorter diagonal, counter-clockwise from outside.
void add_quad(
    const Vector3i& node, int axis, bool outward, const CellVertices& vertices, scene::ScanSurface* mesh) {
  const Vector3i u = Vector3i::Unit((axis + 1) % 3), v = Vector3i::Unit((axis + 2) % 3);
  std::array<std::uint32_t, 4> quad{};
  const std::array<Vector3i, 4> cells = {node - u - v, node - v, node, node - u};  // around +axis
  for (std::size_t i = 0; i < 4; ++i) {
    const auto vertex = vertices.find(key_of(cells[i]));
    if (vertex == vertices.end()) return;
    quad[i] = vertex->second;
  }
  if (!outward) std::swap(quad[1], quad[3]);
  const auto apart = [&](std::size_t a, std::size_t b) {
    return (mesh->positions[quad[a]] - mesh->positions[quad[b]]).squaredNorm();
  };
  if (apart(0, 2) <= apart(1, 3)) {
    mesh->triangles.push_back({quad[0], quad[1], quad[2]});
    mesh->triangles.push_back({quad[0], quad[2], quad[3]});
  } else {
    mesh->triangles.push_back({quad[1], quad[2], quad[3]});
    mesh->triangles.push_back({quad[1], quad[3], quad[0]});
  }
}

scene::ScanSurface net_of(const Grid& grid, const std::vector<std::uint64_t>& cells) {
  scene::ScanSurface mesh;
  CellVertices vertices;
  for (const std::uint64_t cell : cells)
    if (const auto p = vertex_in(grid, place_of(cell))) {
      vertices.emplace(cell, static_cast<std::uint32_t>(mesh.positions.size()));
      mesh.positions.push_back(p->cast<float>());
    }
  for (std::size_t i = 0; i < grid.nodes.size(); ++i) {
    if (std::isnan(grid.distance[i])) continue;
    const Vector3i node = place_of(grid.nodes[i]);
    for (int axis = 0; axis < 3; ++axis) {
      const auto next = grid.number.find(key_of(node + Vector3i::Unit(axis)));
      if (next == grid.number.end() || std::isnan(grid.distance[next->second])) continue;
      const bool inside = grid.distance[i] < 0, next_inside = grid.distance[next->second] < 0;
      if (inside != next_inside) add_quad(node, axis, inside, vertices, &mesh);
    }
  }
  return mesh;
}

// Moves every vertex to the surface that the views measured; vertices without one are removed.
scene::ScanSurface on_the_views(const scene::ScanSurface& mesh,
                                std::span<const RangeView> views,
                                double reach) {
  scene::ScanSurface out = mesh;
  out.normals.assign(mesh.positions.size(), Eigen::Vector3f::Zero());
  out.stddevs.assign(mesh.positions.size(), 0);
  std::vector<bool> keep(mesh.positions.size(), false);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vector3d p = mesh.positions[i].cast<double>();
    const auto seen = surface_sample(views, p, reach);
    if (!seen) continue;
    keep[i] = true;
    out.positions[i] = (p + seen->offset * seen->d_normal).cast<float>();
    out.normals[i] = seen->d_normal.cast<float>();
    out.stddevs[i] = static_cast<float>(seen->stddev);
  }
  return scene::with_vertices_kept(out, keep);
}

}  // namespace

std::optional<SurfaceSample> surface_sample(std::span<const RangeView> views,
                                            const Vector3d& p_world,
                                            double reach) {
  std::optional<SurfaceSample> surest;
  std::vector<SurfaceSample> all;
  for (const RangeView& view : views) {
    const auto seen = surface_sample(view, p_world);
    if (!seen || std::abs(seen->offset) > reach) continue;
    all.push_back(*seen);
    if (!surest || seen->stddev < surest->stddev) surest = seen;
  }
  if (!surest) return surest;
  double weights = 0, offset = 0;
  Vector3d normal = Vector3d::Zero();
  for (const SurfaceSample& one : all) {
    const double apart = std::abs(one.offset - surest->offset);
    const bool agrees = apart <= k_agree_m + k_agree_sigmas * std::hypot(one.stddev, surest->stddev);
    if (one.d_normal.dot(surest->d_normal) < k_same_turn || !agrees) continue;
    const double weight = 1 / (one.stddev * one.stddev);
    weights += weight;
    offset += weight * one.offset;
    normal += weight * one.d_normal;
  }
  return SurfaceSample{offset / weights, 1 / std::sqrt(weights), normal.normalized()};
}

Agreement agreement(const RangeView& a, const RangeView& b, double reach, int samples) {
  const int step =
      std::max(1, static_cast<int>(std::sqrt(static_cast<double>(a.range.total()) / std::max(1, samples))));
  std::vector<double> apart, sigmas;
  for (int y = 0; y < a.range.rows; y += step)
    for (int x = 0; x < a.range.cols; x += step) {
      if (!a.has(x, y)) continue;
      const auto seen = surface_sample(b, a.p_world(x, y));
      if (!seen || std::abs(seen->offset) > reach) continue;
      apart.push_back(std::abs(seen->offset));
      sigmas.push_back(std::abs(seen->offset) /
                       std::hypot(seen->stddev, static_cast<double>(a.stddev.at<float>(y, x))));
    }
  Agreement result;
  result.count = static_cast<int>(apart.size());
  if (apart.empty()) return result;
  for (const double d : apart) result.rms_m += d * d;
  result.rms_m = std::sqrt(result.rms_m / result.count);
  result.median_m = median(std::move(apart));
  result.median_sigmas = median(std::move(sigmas));
  return result;
}

double point_spacing(std::span<const RangeView> views) {
  std::vector<double> distances;
  for (const RangeView& view : views)
    for (int y = 0; y < view.range.rows; y += 7)  // every seventh row
      for (int x = 0; x + 1 < view.range.cols; x += 7)
        if (view.has(x, y) && view.has(x + 1, y))
          distances.push_back((view.p_world(x, y) - view.p_world(x + 1, y)).norm());
  return median(std::move(distances));
}

scene::ScanSurface fused_points(std::span<const RangeView> views) {
  scene::ScanSurface merged;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const scene::ScanSurface own = surface_of(views[v]);
    for (std::size_t i = 0; i < own.positions.size(); ++i) {
      Vector3d p = own.positions[i].cast<double>();
      Vector3d normal = own.normals[i].cast<double>();
      double stddev = own.stddevs[i], weight = 1 / (stddev * stddev), offset = 0;
      bool surest = true;
      for (std::size_t w = 0; w < views.size() && surest; ++w) {
        if (w == v) continue;
        const auto seen = surface_sample(views[w], p);
        if (!seen || seen->d_normal.dot(normal) < k_same_turn) continue;
        if (std::abs(seen->offset) > k_agree_m + k_agree_sigmas * std::hypot(seen->stddev, stddev)) continue;
        surest = seen->stddev > stddev || (seen->stddev == stddev && v < w);
        const double other = 1 / (seen->stddev * seen->stddev);
        offset += other * seen->offset;
        weight += other;
      }
      if (!surest) continue;
      p += offset / weight * normal;
      merged.positions.push_back(p.cast<float>());
      merged.normals.push_back(own.normals[i]);
      merged.stddevs.push_back(static_cast<float>(1 / std::sqrt(weight)));
    }
  }
  return merged;
}

scene::ScanSurface fused_mesh(std::span<const RangeView> views, double voxel_m, double least_area_m2) {
  LIMN_CHECK(voxel_m > 0);
  const std::vector<std::uint64_t> cells = cells_near(views, voxel_m);
  const Grid grid = distances_at(cells, views, voxel_m);
  const scene::ScanSurface mesh = on_the_views(net_of(grid, cells), views, k_truncation * voxel_m);
  const scene::ConnectedComponents pieces = scene::connected_components(mesh);
  std::vector<bool> keep(mesh.positions.size());
  for (std::size_t i = 0; i < keep.size(); ++i)
    keep[i] = pieces.of_vertex[i] >= 0 &&
              pieces.areas[static_cast<std::size_t>(pieces.of_vertex[i])] >= least_area_m2;
  return scene::with_vertices_kept(mesh, keep);
}

}  // namespace limn::calib
