#include "calib/surface/scan_overlap.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <set>

#include "calib/surface/registration_fit.h"

namespace limn::calib {
namespace {

using Eigen::Vector3d;

// Distance that counts as near, as a share of the mesh's diagonal and in metres, and the least shares of scan
// and mesh that are near where both are of one object.
constexpr double k_near = 0.01, k_least_near_m = 3e-3;
constexpr double k_least_scan_share = 0.25, k_least_mesh_share = 0.25;

}  // namespace

std::vector<float> residuals(const scene::MeshBvh& index,
                             const scene::ScanSurface& scan,
                             const Registration& registration,
                             double reach_m) {
  const Pose inverse = registration.world_from_prototype.inverse();
  std::vector<float> out(scan.positions.size(), std::numeric_limits<float>::quiet_NaN());
  cv::parallel_for_(cv::Range(0, static_cast<int>(out.size())), [&](const cv::Range& range) {
    for (int k = range.start; k < range.end; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const auto off = off_mesh(index, inverse * scan.positions[i].cast<double>(),
                                inverse.rotation * scan.normals[i].cast<double>(), reach_m);
      if (off) out[i] = static_cast<float>(off->distance);
    }
  });
  return out;
}

Overlap overlap(const scene::Mesh& mesh,
                const scene::MeshBvh& index,
                const scene::ScanSurface& scan,
                const Pose& world_from_prototype,
                const RegistrationOptions& options) {
  Overlap out;
  const double size = diagonal_of(mesh.positions), cell = options.cell * size;
  out.near_m = std::max(k_least_near_m, k_near * size);
  const auto points = thinned(scan, cell);
  out.scan_points = static_cast<int>(points.size());
  const std::vector<FitRow> rows = fit_rows(index, points, world_from_prototype, out.near_m);
  out.scan_share = static_cast<double>(rows.size()) / std::max(1, out.scan_points);

  // The mesh's area by cells of the same size, and which of them have a scan point.
  std::set<ScanCell> scanned;
  const Pose inverse = world_from_prototype.inverse();
  for (const FitRow& row : rows)
    if (const auto nearest = index.nearest(inverse * row.p, 2 * out.near_m))
      scanned.insert(scan_cell_of(nearest->p, 2 * cell));
  double area = 0, near = 0;
  for (const auto& [i, j, k] : mesh.triangles) {
    const Vector3d a = mesh.positions[i].cast<double>(), ab = mesh.positions[j].cast<double>() - a,
                   ac = mesh.positions[k].cast<double>() - a;
    const double own = ab.cross(ac).norm() / 2;
    // A large triangle is judged at many places, evenly spread over it (Roberts' R2 sequence).
    const int places = std::clamp(static_cast<int>(own / (cell * cell)), 1, 10'000);
    for (int n = 0; n < places; ++n) {
      double u = std::fmod(0.5 + 0.7548776662466927 * n, 1), v = std::fmod(0.5 + 0.5698402909980532 * n, 1);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      area += own / places;
      if (scanned.contains(scan_cell_of(a + u * ab + v * ac, 2 * cell))) near += own / places;
    }
  }
  out.mesh_share = area > 0 ? near / area : 0;
  return out;
}

Status check_overlap(const Overlap& overlap) {
  if (overlap.scan_share >= k_least_scan_share || overlap.mesh_share >= k_least_mesh_share) return {};
  return error(
      "only {:.0f} % of the scan lies within {:.0f} mm of the CAD, and only {:.0f} % of the CAD's surface is "
      "covered by the scan: expected at least {:.0f} % of one of them. Is this the CAD of the scanned "
      "object? "
      "If so, check --units, scan more of it, cut the background off (limn scan --far, --pieces), or give "
      "another --start.",
      100 * overlap.scan_share, 1e3 * overlap.near_m, 100 * overlap.mesh_share, 100 * k_least_scan_share);
}

std::vector<Difference> differences(const scene::ScanSurface& scan,
                                    const std::vector<float>& residuals,
                                    const Registration& registration,
                                    const DifferenceOptions& options) {
  const Pose inverse = registration.world_from_prototype.inverse();
  const auto limit = [&](std::size_t i) {
    const Vector3d n = scan.normals[i].cast<double>();
    Vector6d jacobian;
    jacobian << (scan.positions[i].cast<double>() - registration.world_from_prototype.translation).cross(n),
        n;
    const double own = scan.stddevs.empty() ? 0 : static_cast<double>(scan.stddevs[i]);
    return std::max(options.least_m,
                    options.sigmas * std::sqrt(own * own + jacobian.dot(registration.covariance * jacobian)));
  };
  std::vector<Difference> found;
  for (const double side : {1.0, -1.0}) {
    std::vector<bool> beyond(residuals.size());
    std::vector<double> sizes;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      beyond[i] = side * static_cast<double>(residuals[i]) > limit(i);
      if (beyond[i]) sizes.push_back(residuals[i]);
    }
    const scene::ScanSurface part = scene::with_vertices_kept(scan, beyond);
    const scene::ConnectedComponents pieces = scene::connected_components(part);
    std::vector<Difference> regions(pieces.areas.size());
    std::vector<int> counts(pieces.areas.size(), 0);
    for (std::size_t i = 0; i < part.positions.size(); ++i) {
      if (pieces.of_vertex[i] < 0) continue;
      const auto at = static_cast<std::size_t>(pieces.of_vertex[i]);
      Difference& region = regions[at];
      ++counts[at];
      region.p_prototype += inverse * part.positions[i].cast<double>();
      region.mean_m += sizes[i];
      if (std::abs(sizes[i]) > std::abs(region.worst_m)) region.worst_m = sizes[i];
    }
    for (std::size_t at = 0; at < regions.size(); ++at) {
      if (pieces.areas[at] < options.least_area_m2) continue;
      regions[at].area_m2 = pieces.areas[at];
      regions[at].p_prototype /= counts[at];
      regions[at].mean_m /= counts[at];
      found.push_back(regions[at]);
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.area_m2 > b.area_m2; });
  return found;
}

}  // namespace limn::calib
