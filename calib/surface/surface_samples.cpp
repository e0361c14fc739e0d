#include "calib/surface/surface_samples.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <utility>

namespace limn::calib {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
using Corners = std::array<std::uint32_t, 3>;

// Divided triangles have two to three corners in each square of the spacing.
constexpr double k_corners_per_square = 3;
// Long, narrow triangles have many more corners than their area says; dividing ends at this many per `most`.
constexpr std::size_t k_most_divided = 4;

// Cosine of the angle from which on a corner's normal is one of shading, which rounds an edge that is sharp.
constexpr float k_shading = 0.866F;  // 30 degrees

// Half the cross product of two sides: along the normal, as long as the area.
Vector3d area_vector(const Vector3f& a, const Vector3f& b, const Vector3f& c) {
  return (b - a).cast<double>().cross((c - a).cast<double>()) / 2;
}

double triangle_area(const Vector3f& a, const Vector3f& b, const Vector3f& c) {
  return area_vector(a, b, c).norm();
}

Vector3d area_vector(const scene::ScanSurface& surface, const Corners& t) {
  return area_vector(surface.positions[t[0]], surface.positions[t[1]], surface.positions[t[2]]);
}

// Gives triangles corners of their own, with the triangle's normal, where the mesh's normal is one of
// shading: along it the distance to a face would be too large. Normals on the other side stay: there the
// triangle is inside out.
void split_shaded_corners(scene::ScanSurface* surface) {
  for (Corners& triangle : surface->triangles) {
    const Vector3f a = surface->positions[triangle[0]];
    const Vector3f n =
        (surface->positions[triangle[1]] - a).cross(surface->positions[triangle[2]] - a).normalized();
    for (std::uint32_t& corner : triangle) {
      const float cosine = surface->normals[corner].dot(n);
      if (!(cosine > 0 && cosine < k_shading)) continue;
      const Vector3f p = surface->positions[corner];
      corner = static_cast<std::uint32_t>(surface->positions.size());
      surface->positions.push_back(p);
      surface->normals.push_back(n);
    }
  }
}

scene::ScanSurface with_points_of_triangles(const scene::ScanSurface& surface) {
  std::vector<bool> is_used(surface.positions.size(), false);
  for (const Corners& triangle : surface.triangles)
    for (const std::uint32_t corner : triangle) is_used[corner] = true;
  return scene::with_vertices_kept(surface, is_used);
}

// The middles of edges that were divided, by the edge's corners.
class Middles {
 public:
  explicit Middles(scene::ScanSurface* surface) : surface_(*surface) {}

  std::uint32_t between(std::uint32_t a, std::uint32_t b) {
    const auto key = (static_cast<std::uint64_t>(std::min(a, b)) << 32) | std::max(a, b);
    const auto [at, fresh] = middles_.try_emplace(key, static_cast<std::uint32_t>(surface_.positions.size()));
    if (fresh) {
      surface_.positions.push_back((surface_.positions[a] + surface_.positions[b]) / 2);
      const Vector3f sum = surface_.normals[a] + surface_.normals[b];
      surface_.normals.push_back(sum.squaredNorm() > 1e-6f ? Vector3f(sum.normalized())
                                                           : surface_.normals[a]);
    }
    return at->second;
  }

 private:
  scene::ScanSurface& surface_;
  std::unordered_map<std::uint64_t, std::uint32_t> middles_;
};

// Divides a triangle at its long edges. An edge is divided by its length alone, so that both of its triangles
// get the same corner. Returns whether there was one.
bool divide(const Corners& t,
            float longest,
            Middles* middles,
            const scene::ScanSurface& surface,
            std::vector<Corners>* out) {
  std::array<bool, 3> is_long{};  // edge k is from corner k to the next one
  for (std::size_t k = 0; k < 3; ++k)
    is_long[k] = (surface.positions[t[k]] - surface.positions[t[(k + 1) % 3]]).norm() > longest;
  const auto count = std::count(is_long.begin(), is_long.end(), true);
  if (count == 0) return false;
  const auto middle = [&](std::size_t k) { return middles->between(t[k % 3], t[(k + 1) % 3]); };
  if (count == 3) {
    const std::uint32_t ab = middle(0), bc = middle(1), ca = middle(2);
    out->insert(out->end(), {{t[0], ab, ca}, {ab, t[1], bc}, {ca, bc, t[2]}, {ab, bc, ca}});
    return true;
  }
  // The one edge that differs from the others is first.
  std::size_t k = 0;
  while (is_long[k] != (count == 1)) ++k;
  const std::uint32_t a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
  if (count == 1) {
    const std::uint32_t ab = middle(k);
    out->insert(out->end(), {{a, ab, c}, {ab, b, c}});
  } else {
    const std::uint32_t bc = middle(k + 1), ca = middle(k + 2);
    out->insert(out->end(), {{ca, bc, c}, {a, b, bc}, {a, bc, ca}});
  }
  return true;
}

void divide_all(double spacing_m, std::size_t most, scene::ScanSurface* surface) {
  std::vector<Corners> done, open;
  std::swap(open, surface->triangles);
  const auto longest = static_cast<float>(spacing_m);
  while (!open.empty() && surface->positions.size() < most) {
    Middles middles(surface);
    std::vector<Corners> next;
    for (const Corners& triangle : open)
      if (!divide(triangle, longest, &middles, *surface, &next)) done.push_back(triangle);
    std::swap(open, next);
  }
  done.insert(done.end(), open.begin(), open.end());
  surface->triangles = std::move(done);
}

std::vector<float> areas_at_points(const scene::ScanSurface& surface) {
  std::vector<float> areas(surface.positions.size(), 0);
  for (const auto& [i, j, k] : surface.triangles) {
    const auto third = static_cast<float>(
        triangle_area(surface.positions[i], surface.positions[j], surface.positions[k]) / 3);
    for (const std::uint32_t corner : {i, j, k}) areas[corner] += third;
  }
  return areas;
}

// A cell of space and the axis that a point there faces.
struct CellKey {
  std::array<std::int32_t, 4> values;
  bool operator==(const CellKey&) const = default;
};
struct CellHash {
  std::size_t operator()(const CellKey& key) const {
    std::uint64_t hash = 0;
    for (const std::int32_t value : key.values)
      hash = (hash ^ static_cast<std::uint32_t>(value)) * 0x9E3779B97F4A7C15U;
    return static_cast<std::size_t>(hash ^ (hash >> 32));
  }
};

CellKey cell_key(const Vector3f& p, const Vector3f& n, double cell) {
  CellKey key{};
  for (int axis = 0; axis < 3; ++axis)
    key.values[static_cast<std::size_t>(axis)] =
        static_cast<std::int32_t>(std::floor(static_cast<double>(p[axis]) / cell));
  Eigen::Index axis = 0;
  n.cwiseAbs().maxCoeff(&axis);
  key.values[3] = static_cast<std::int32_t>(2 * axis + (n[axis] > 0 ? 1 : 0));
  return key;
}

// The cell of every point, numbered in the order of their first points, and their number.
std::pair<std::vector<std::uint32_t>, std::size_t> cells_of(const scene::ScanSurface& surface, double cell) {
  std::unordered_map<CellKey, std::uint32_t, CellHash> numbers;
  std::vector<std::uint32_t> of_point(surface.positions.size());
  for (std::size_t i = 0; i < of_point.size(); ++i)
    of_point[i] = numbers
                      .try_emplace(cell_key(surface.positions[i], surface.normals[i], cell),
                                   static_cast<std::uint32_t>(numbers.size()))
                      .first->second;
  return {std::move(of_point), numbers.size()};
}

// For each cell the point that is nearest to the middle of its points.
std::vector<std::uint32_t> chosen_points(const scene::ScanSurface& surface,
                                         const std::vector<std::uint32_t>& cell_of_point,
                                         std::size_t cells) {
  std::vector<Vector3f> middles(cells, Vector3f::Zero());
  std::vector<float> counts(cells, 0), nearest(cells, std::numeric_limits<float>::infinity());
  std::vector<std::uint32_t> chosen(cells, 0);
  for (std::size_t i = 0; i < cell_of_point.size(); ++i) {
    middles[cell_of_point[i]] += surface.positions[i];
    ++counts[cell_of_point[i]];
  }
  for (std::size_t i = 0; i < cell_of_point.size(); ++i) {
    const std::uint32_t cell = cell_of_point[i];
    const float distance = (surface.positions[i] - middles[cell] / counts[cell]).squaredNorm();
    if (!(distance < nearest[cell])) continue;
    nearest[cell] = distance;
    chosen[cell] = static_cast<std::uint32_t>(i);
  }
  return chosen;
}

SurfaceSamples merged_samples(const SurfaceSamples& fine, std::size_t most) {
  constexpr double k_larger = 1.25;
  double cell = fine.spacing_m;
  auto numbered = cells_of(fine.surface, cell);
  while (numbered.second > most) numbered = cells_of(fine.surface, cell *= k_larger);
  const auto& [cell_of_point, cells] = numbered;
  SurfaceSamples out;
  out.spacing_m = cell;
  out.areas_m2.assign(cells, 0);
  for (const std::uint32_t i : chosen_points(fine.surface, cell_of_point, cells)) {
    out.surface.positions.push_back(fine.surface.positions[i]);
    out.surface.normals.push_back(fine.surface.normals[i]);
  }
  for (std::size_t i = 0; i < cell_of_point.size(); ++i) out.areas_m2[cell_of_point[i]] += fine.areas_m2[i];
  for (const Corners& triangle : fine.surface.triangles) {
    const Corners corners = {cell_of_point[triangle[0]], cell_of_point[triangle[1]],
                             cell_of_point[triangle[2]]};
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) continue;
    // Merging turns some small triangles over. Nearly all of these have the corners of one that was not
    // turned.
    if (area_vector(out.surface, corners).dot(area_vector(fine.surface, triangle)) > 0)
      out.surface.triangles.push_back(corners);
  }
  // Several small triangles may span the same three cells.
  for (Corners& t : out.surface.triangles)
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  std::sort(out.surface.triangles.begin(), out.surface.triangles.end());
  out.surface.triangles.erase(std::unique(out.surface.triangles.begin(), out.surface.triangles.end()),
                              out.surface.triangles.end());
  return out;
}

}  // namespace

double area_of(const scene::Mesh& mesh) {
  double sum = 0;
  for (const auto& [i, j, k] : mesh.triangles)
    sum += triangle_area(mesh.positions[i], mesh.positions[j], mesh.positions[k]);
  return sum;
}

SurfaceSamples surface_samples(const scene::Mesh& mesh, double spacing_m, std::size_t most) {
  constexpr double k_least_area_m2 = 1e-14;  // rounding alone
  SurfaceSamples out;
  out.spacing_m =
      std::max(spacing_m, std::sqrt(k_corners_per_square * area_of(mesh) / static_cast<double>(most)));
  out.surface.positions = mesh.positions;
  out.surface.normals = mesh.normals;
  for (const auto& [i, j, k] : mesh.triangles)
    if (triangle_area(mesh.positions[i], mesh.positions[j], mesh.positions[k]) > k_least_area_m2)
      out.surface.triangles.push_back({i, j, k});
  split_shaded_corners(&out.surface);
  out.surface = with_points_of_triangles(out.surface);
  divide_all(out.spacing_m, std::max(k_most_divided * most, out.surface.positions.size() + most),
             &out.surface);
  out.areas_m2 = areas_at_points(out.surface);
  if (out.surface.positions.size() > most) return merged_samples(out, most);
  return out;
}

}  // namespace limn::calib
