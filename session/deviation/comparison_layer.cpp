#include "session/deviation/comparison_layer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "calib/surface/deviation_scale.h"
#include "core/parallel.h"
#include "scene/meshes/mesh_bvh.h"

namespace limn::session {
namespace {

using Eigen::Vector3d;

constexpr std::size_t k_most_values = 4'000'000;
constexpr std::uint32_t k_most_divisions = 1 << 13;
// Weight of an unmeasured corner below which a point counts as measured.
constexpr double k_no_weight = 1e-3;

std::array<Vector3d, 3> corners_of(const scene::Mesh& mesh, std::size_t triangle) {
  const auto& [a, b, c] = mesh.triangles[triangle];
  return {mesh.positions[a].cast<double>(), mesh.positions[b].cast<double>(),
          mesh.positions[c].cast<double>()};
}

// The grid of each triangle, whose pieces are at most `spacing_m` long, and the number of all points.
std::size_t divide(const scene::Mesh& cad,
                   double spacing_m,
                   std::vector<scene::DeviationLayer::Triangle>* triangles) {
  std::size_t points = 0;
  triangles->resize(cad.triangles.size());
  for (std::size_t t = 0; t < cad.triangles.size(); ++t) {
    const auto [a, b, c] = corners_of(cad, t);
    const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
    const auto pieces = std::clamp(std::ceil(longest / spacing_m), 1.0, 1.0 * k_most_divisions);
    (*triangles)[t] = {static_cast<std::uint32_t>(points), static_cast<std::uint32_t>(pieces)};
    points += scene::points_of_divisions(static_cast<std::size_t>(pieces));
  }
  return points;
}

// The points of a comparison as a mesh, for nearest-point queries.
scene::Mesh mesh_of(const calib::Deviation& deviation) {
  scene::Mesh mesh;
  mesh.positions = deviation.cad.surface.positions;
  mesh.normals = deviation.cad.surface.normals;
  mesh.triangles = deviation.cad.surface.triangles;
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
}

// Interpolates a comparison anywhere on the CAD.
class Interpolation {
 public:
  explicit Interpolation(const calib::Deviation& deviation)
      : deviation_(deviation), mesh_(mesh_of(deviation)), index_(mesh_) {}

  // `d_face`: the normal of the CAD's triangle there.
  std::uint32_t at(const Vector3d& p, const Vector3d& d_face) const {
    const auto nearest = index_.nearest(p, 2 * deviation_.cad.spacing_m, &d_face);
    if (!nearest) return scene::k_no_deviation;
    const std::array<double, 3> weights = weights_at(nearest->p, nearest->triangle);
    double distance = 0, stddev = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t corner = mesh_.triangles[nearest->triangle][k];
      if (weights[k] < k_no_weight) continue;
      if (!deviation_.has(corner)) return scene::k_no_deviation;
      distance += weights[k] * static_cast<double>(deviation_.distances_m[corner]);
      stddev += weights[k] * static_cast<double>(deviation_.stddevs_m[corner]);
    }
    return scene::deviation_value(distance, stddev);
  }

 private:
  std::array<double, 3> weights_at(const Vector3d& p, std::size_t triangle) const {
    const auto [a, b, c] = corners_of(mesh_, triangle);
    const Vector3d n = (b - a).cross(c - a);
    const double area = n.squaredNorm();
    if (!(area > 0)) return {1, 0, 0};
    const double of_b = std::clamp((p - a).cross(c - a).dot(n) / area, 0.0, 1.0),
                 of_c = std::clamp((b - a).cross(p - a).dot(n) / area, 0.0, 1.0 - of_b);
    return {1 - of_b - of_c, of_b, of_c};
  }

  const calib::Deviation& deviation_;
  scene::Mesh mesh_;
  scene::MeshBvh index_;
};

void fill_triangle(const Interpolation& values,
                   const std::array<Vector3d, 3>& corners,
                   const scene::DeviationLayer::Triangle& triangle,
                   std::uint32_t* out) {
  const auto& [a, b, c] = corners;
  const Vector3d cross = (b - a).cross(c - a);
  const Vector3d d_face = cross.norm() > 0 ? Vector3d(cross.normalized()) : Vector3d(0, 0, 1);
  const Vector3d along = (b - a) / triangle.divisions, up = (c - a) / triangle.divisions;
  for (std::uint32_t j = 0; j <= triangle.divisions; ++j)
    for (std::uint32_t i = 0; i + j <= triangle.divisions; ++i)
      *out++ = values.at(a + i * along + j * up, d_face);
}

Eigen::Vector3f linear(const std::array<std::uint8_t, 3>& rgb) {
  Eigen::Vector3f light;
  for (int i = 0; i < 3; ++i) {
    const double share = rgb[static_cast<std::size_t>(i)] / 255.0;
    light[i] = static_cast<float>(share <= 0.04045 ? share / 12.92 : std::pow((share + 0.055) / 1.055, 2.4));
  }
  return light;
}

}  // namespace

scene::DeviationLayer comparison_layer(const scene::Mesh& cad,
                                       const calib::DeviationReport& report,
                                       int number) {
  constexpr double k_coarser = 1.25;
  scene::DeviationLayer layer;
  layer.number = number;
  double spacing_m = std::max(1e-4, report.deviation.cad.spacing_m);
  std::size_t points = divide(cad, spacing_m, &layer.triangles);
  // Each triangle has three points at least, however coarse the grid is.
  const std::size_t most = std::max(k_most_values, 4 * cad.triangles.size());
  while (points > most) points = divide(cad, spacing_m *= k_coarser, &layer.triangles);
  layer.values.resize(points);
  const Interpolation values(report.deviation);
  constexpr std::size_t k_at_once = 256;
  const std::size_t groups = (cad.triangles.size() + k_at_once - 1) / k_at_once;
  parallel_for(static_cast<int>(groups), [&](int group) {
    const std::size_t begin = static_cast<std::size_t>(group) * k_at_once;
    for (std::size_t t = begin; t < std::min(begin + k_at_once, cad.triangles.size()); ++t)
      fill_triangle(values, corners_of(cad, t), layer.triangles[t],
                    layer.values.data() + layer.triangles[t].first);
  });
  constexpr int k_bands = calib::k_deviation_bands;
  for (int band = -k_bands; band <= k_bands; ++band)
    layer.band_colours[static_cast<std::size_t>(band + k_bands)] = linear(calib::band_colour_rgb(band));
  for (const calib::DeviationExtreme& extreme : report.extremes)
    layer.marks.push_back({extreme.p_prototype,
                           report.deviation.cad.surface.normals[extreme.sample].cast<double>(),
                           extreme.distance_m});
  layer.unsure = report.registration.free_directions;
  return layer;
}

}  // namespace limn::session
