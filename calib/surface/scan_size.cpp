#include "calib/surface/scan_size.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "calib/surface/scan_overlap.h"

namespace limn::calib {
namespace {

using Eigen::Vector3d;
// Rotation, translation and growth of the scan, all as metres at the points' radius.
using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

constexpr double k_cell_share = 1 / 20.0;  // share of the mesh's diagonal
constexpr int k_most_passes = 12;
constexpr double k_settled_ratio = 1e-5;
constexpr double k_reach_share = 0.01;  // share of the mesh's diagonal
constexpr double k_least_reach_m = 3e-3;
constexpr std::size_t k_least_near = 100;
constexpr double k_unknown_m = 1;  // standard deviation of a weak prior

scene::ScanSurface scaled(scene::ScanSurface scan, double factor) {
  for (Eigen::Vector3f& p : scan.positions) p *= static_cast<float>(factor);
  return scan;
}

struct Point {
  Vector3d p, d_normal;  // world
  double residual = 0;
};

std::vector<Point> points_near(const scene::MeshBvh& index,
                               const scene::ScanSurface& scan,
                               const Registration& registration,
                               double reach_m) {
  std::vector<Point> points;
  const std::vector<float> distances = residuals(index, scan, registration, reach_m);
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (std::isfinite(distances[i]))
      points.push_back({scan.positions[i].cast<double>(), scan.normals[i].cast<double>(),
                        static_cast<double>(distances[i])});
  }
  return points;
}

double variance_of(const std::vector<Point>& points) {
  constexpr double k_least_m = 1e-5;
  double squared = 0;
  for (const Point& point : points) squared += point.residual * point.residual;
  return std::max(k_least_m * k_least_m, squared / static_cast<double>(points.size()));
}

// One step of the growth, and its sandwich covariance (Huber 1967).
ScanSize growth_of(const std::vector<Point>& points, double cell_m) {
  Vector3d pivot = Vector3d::Zero();
  for (const Point& point : points) pivot += point.p / static_cast<double>(points.size());
  double squared = 0;
  for (const Point& point : points) squared += (point.p - pivot).squaredNorm();
  const double radius = std::sqrt(squared / static_cast<double>(points.size()));
  const double prior = variance_of(points) / (k_unknown_m * k_unknown_m);
  Matrix7d normal = prior * Matrix7d::Identity();
  Vector7d gradient = Vector7d::Zero();
  std::map<std::array<long, 3>, Vector7d> sums;
  for (const Point& point : points) {
    const Vector3d arm = (point.p - pivot) / radius;
    Vector7d row;
    row << arm.cross(point.d_normal), point.d_normal, arm.dot(point.d_normal);
    normal += row * row.transpose();
    gradient += point.residual * row;
    std::array<long, 3> cell{};
    for (int axis = 0; axis < 3; ++axis)
      cell[static_cast<std::size_t>(axis)] = std::lround(point.p[axis] / cell_m);
    sums.try_emplace(cell, Vector7d::Zero()).first->second += point.residual * row;
  }
  const Matrix7d inverse = normal.inverse();
  const Vector7d step = inverse * gradient;
  Matrix7d middle = Matrix7d::Zero();
  for (const auto& [cell, sum] : sums) middle += sum * sum.transpose();
  const auto cells = static_cast<double>(sums.size());
  middle *= cells / std::max(1.0, cells - 7);
  middle += std::pow(prior * k_unknown_m, 2) * Matrix7d::Identity();  // directions that no point determines
  const double variance = (inverse * middle * inverse)(6, 6);
  return {1 + step[6] / radius, std::sqrt(std::max(0.0, variance)) / radius};
}

}  // namespace

Result<ScanSize> scan_size(const scene::Mesh& mesh,
                           const scene::MeshBvh& index,
                           const scene::ScanSurface& scan,
                           const Registration& registration) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p);
  const auto diagonal = static_cast<double>(box.diagonal().norm());
  const double reach_m = std::max(k_least_reach_m, k_reach_share * diagonal);
  ScanSize size;
  Registration at = registration;
  for (int pass = 0; pass < k_most_passes; ++pass) {
    const scene::ScanSurface now = scaled(scan, 1 / size.ratio);
    Pose start = registration.world_from_prototype;
    start.translation /= size.ratio;
    if (pass > 0) {
      LIMN_TRY(at, refined_registration(mesh, index, now, start));
    }
    const std::vector<Point> points = points_near(index, now, at, reach_m);
    if (points.size() < k_least_near)
      return error("size of the scan: expected {} points near the mesh, found {}. Scan more of it.",
                   k_least_near, points.size());
    const ScanSize step = growth_of(points, k_cell_share * diagonal);
    size = {size.ratio * step.ratio, step.stddev};
    if (std::abs(step.ratio - 1) < std::max(k_settled_ratio, step.stddev / 10)) break;
  }
  return size;
}

bool contradicts(const ScanSize& size) {
  return std::abs(size.ratio - 1) > std::max(k_size_tolerance, 3 * size.stddev);
}

}  // namespace limn::calib
