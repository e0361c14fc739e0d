#include "calib/surface/global_registration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

#include "calib/surface/registration_fit.h"

namespace limn::calib {
namespace {

using Eigen::Vector3d;

// Truncated distances from the mesh on a grid around it, for fast tests of many poses.
class DistanceField {
 public:
  DistanceField(const scene::Mesh& mesh, const scene::MeshBvh& index, double limit) : limit_(limit) {
    constexpr int k_cells = 48;  // along the longest side
    Eigen::AlignedBox3d box;
    for (const auto& p : mesh.positions) box.extend(p.cast<double>());
    low_ = box.min() - Vector3d::Constant(limit);
    const Vector3d size = box.sizes() + Vector3d::Constant(2 * limit);
    cell_ = size.maxCoeff() / k_cells;
    for (int axis = 0; axis < 3; ++axis)
      counts_[axis] = std::max(1, static_cast<int>(std::ceil(size[axis] / cell_)));
    values_.assign(static_cast<std::size_t>(counts_.prod()), static_cast<float>(limit));
    cv::parallel_for_(cv::Range(0, static_cast<int>(values_.size())), [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) {
        const Eigen::Vector3i at(i % counts_.x(), i / counts_.x() % counts_.y(),
                                 i / counts_.x() / counts_.y());
        const Vector3d p = low_ + (at.cast<double>() + Vector3d::Constant(0.5)) * cell_;
        if (const auto nearest = index.nearest(p, limit))
          values_[static_cast<std::size_t>(i)] = static_cast<float>(nearest->distance);
      }
    });
  }

  double at(const Vector3d& p) const {
    const Vector3d place = (p - low_) / cell_;
    if ((place.array() < 0).any() || (place.array() >= counts_.cast<double>().array()).any()) return limit_;
    const Eigen::Vector3i c = place.cast<int>();
    return values_[static_cast<std::size_t>((c.z() * counts_.y() + c.y()) * counts_.x() + c.x())];
  }
  double limit() const { return limit_; }

 private:
  double limit_, cell_ = 1;
  Vector3d low_;
  Eigen::Vector3i counts_;
  std::vector<float> values_;
};

// Evenly spread rotations (Alexa, Super-Fibonacci Spirals, CVPR 2022).
Eigen::Quaterniond spread_rotation(int i, int count) {
  constexpr double k_phi = std::numbers::sqrt2, k_psi = 1.533751168755204288118041;
  const double s = i + 0.5, r = std::sqrt(s / count), big_r = std::sqrt(1 - s / count);
  const double alpha = 2 * std::numbers::pi * s / k_phi, beta = 2 * std::numbers::pi * s / k_psi;
  return {big_r * std::cos(beta), r * std::sin(alpha), r * std::cos(alpha), big_r * std::sin(beta)};
}

// Centres and areas of the mesh's triangles.
struct Patch {
  Vector3d p, n;
  double area = 0;
};
// Takes some of very many triangles, evenly: they are only used for coarse poses.
std::vector<Patch> patches_of(const scene::Mesh& mesh) {
  constexpr std::size_t k_most = 50'000;
  const std::size_t step = mesh.triangles.size() / k_most + 1;
  std::vector<Patch> patches;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += step) {
    const auto& [i, j, k] = mesh.triangles[t];
    const Vector3d a = mesh.positions[i].cast<double>(), b = mesh.positions[j].cast<double>(),
                   c = mesh.positions[k].cast<double>();
    const Vector3d area = (b - a).cross(c - a) / 2;
    patches.push_back({(a + b + c) / 3, area.normalized(), area.norm()});
  }
  return patches;
}

// The centre of the surface that faces direction d, ignoring occlusion.
Vector3d middle_seen(const std::vector<Patch>& patches, const Vector3d& d) {
  Vector3d sum = Vector3d::Zero();
  double weights = 0;
  for (const Patch& patch : patches) {
    const double weight = patch.area * std::max(0.0, patch.n.dot(d));
    sum += weight * patch.p;
    weights += weight;
  }
  return weights > 0 ? Vector3d(sum / weights) : Vector3d::Zero();
}

struct PlacedCandidate {
  Pose pose;
  double cost = 0;  // mean of the squared truncated distances as a share of the limit
};

void keep_best(std::size_t count, std::vector<PlacedCandidate>* candidates) {
  std::stable_sort(candidates->begin(), candidates->end(),
                   [](const auto& a, const auto& b) { return a.cost < b.cost; });
  if (candidates->size() > count) candidates->resize(count);
}

double field_cost(const DistanceField& field, const std::vector<ScanPoint>& points, const Pose& pose) {
  const Pose inverse = pose.inverse();
  const Eigen::Matrix3d r = inverse.rotation_matrix();
  double sum = 0;
  for (const ScanPoint& point : points) {
    const double share = field.at(r * point.p + inverse.translation) / field.limit();
    sum += share * share;
  }
  return sum / static_cast<double>(points.size());
}

std::vector<ScanPoint> every(const std::vector<ScanPoint>& points, std::size_t about) {
  const std::size_t step = std::max<std::size_t>(1, points.size() / about);
  std::vector<ScanPoint> out;
  for (std::size_t i = step / 2; i < points.size(); i += step) out.push_back(points[i]);
  return out;
}

std::vector<PlacedCandidate> coarse_poses(const std::vector<Patch>& patches,
                                          const DistanceField& field,
                                          const std::vector<ScanPoint>& points,
                                          double mesh_diagonal) {
  constexpr int k_turns = 1200;  // about 20 degrees apart
  constexpr std::size_t k_quick_points = 250, k_kept = 30;
  const std::vector<ScanPoint> few = every(points, k_quick_points);
  Vector3d middle = Vector3d::Zero(), d_scanner = Vector3d::Zero();
  for (const ScanPoint& point : few) d_scanner += point.n;
  d_scanner.normalize();
  double weights = 0;
  for (const ScanPoint& point : few) {
    const double weight = std::max(0.05, point.n.dot(d_scanner));
    middle += weight * point.p;
    weights += weight;
  }
  middle /= weights;
  const Vector3d u = d_scanner.unitOrthogonal(), v = d_scanner.cross(u);
  std::vector<PlacedCandidate> best;
  for (int i = 0; i < k_turns; ++i) {
    const Eigen::Quaterniond rotation = spread_rotation(i, k_turns);
    const Vector3d p_mesh = middle_seen(patches, rotation.conjugate() * d_scanner);
    PlacedCandidate here{Pose(), std::numeric_limits<double>::infinity()};
    for (int a = -2; a <= 2; ++a)
      for (int b = -2; b <= 2; ++b) {
        const Vector3d beside = 0.09 * mesh_diagonal * (a * u + b * v);
        const Pose pose(rotation, middle + beside - rotation * p_mesh);
        const double cost = field_cost(field, few, pose);
        if (cost < here.cost) here = {pose, cost};
      }
    best.push_back(here);
  }
  keep_best(k_kept, &best);
  return best;
}

bool same_pose(const Pose& a, const Pose& b, const Vector3d& p, double mesh_diagonal) {
  constexpr double k_same_turn = 5 * std::numbers::pi / 180, k_same_place = 0.02;
  return angle_between(a.rotation, b.rotation) < k_same_turn &&
         (a * p - b * p).norm() < k_same_place * mesh_diagonal;
}

// Number of points of the scan within `within` of the mesh.
int explained(const scene::MeshBvh& index,
              const std::vector<ScanPoint>& points,
              const Pose& pose,
              double within) {
  return static_cast<int>(fit_rows(index, points, pose, within).size());
}

struct Tried {
  RegistrationFit fit;
  int explained = 0;
};

}  // namespace

Result<GlobalRegistration> global_registration(const scene::Mesh& mesh,
                                               const scene::MeshBvh& index,
                                               const scene::ScanSurface& scan,
                                               const RegistrationOptions& options) {
  constexpr std::size_t k_pieces = 4, k_short_points = 160, k_long_points = 600, k_long = 4;
  constexpr int k_short_steps = 15;
  // Share of the mesh's diagonal; a larger piece is a wall.
  constexpr double k_largest = 1.3, k_smallest = 0.2;
  const double size = diagonal_of(mesh.positions);
  const DistanceField field(mesh, index, 0.1 * size);
  const std::vector<Patch> patches = patches_of(mesh);
  const scene::ConnectedComponents pieces = scene::connected_components(scan);
  const auto all = thinned(scan, options.cell * size);
  const double within = 0.004 * size;
  std::vector<Tried> fits;
  for (std::size_t piece = 0; piece < std::max<std::size_t>(1, std::min(k_pieces, pieces.areas.size()));
       ++piece) {
    std::vector<bool> keep;
    for (const int of : pieces.of_vertex)
      keep.push_back(pieces.areas.empty() || of == static_cast<int>(piece));
    const scene::ScanSurface part = scene::with_vertices_kept(scan, keep);
    const double extent = diagonal_of(part.positions);
    if (!pieces.areas.empty() && (extent > k_largest * size || extent < k_smallest * size)) continue;
    const auto points = every(thinned(part, options.cell * size), k_long_points);
    if (static_cast<int>(points.size()) < 4 * k_least_fit_points) continue;
    const auto some = every(points, k_short_points);
    std::vector<PlacedCandidate> shorts;
    for (const PlacedCandidate& candidate : coarse_poses(patches, field, points, size)) {
      const auto fit = fit_registration(index, some, candidate.pose, 0.15 * size, k_short_steps);
      if (fit)
        shorts.push_back(
            {fit->pose, -explained(index, some, fit->pose, within) / static_cast<double>(some.size())});
    }
    keep_best(shorts.size(), &shorts);
    std::vector<Pose> tried;
    for (const PlacedCandidate& candidate : shorts) {
      const bool again = std::any_of(tried.begin(), tried.end(), [&](const Pose& pose) {
        return same_pose(pose, candidate.pose, patches[0].p, size);
      });
      if (again) continue;
      tried.push_back(candidate.pose);
      auto fit = fit_registration(index, points, candidate.pose, 0.05 * size, options.max_iterations);
      if (fit) fits.push_back({*fit, explained(index, all, fit->pose, within)});
      if (tried.size() == k_long) break;
    }
  }
  std::stable_sort(fits.begin(), fits.end(),
                   [](const auto& a, const auto& b) { return a.explained > b.explained; });
  const double least = 0.02 * static_cast<double>(all.size());
  if (fits.empty() || fits[0].explained < least)
    return error(
        "found no pose in which the mesh lies on the scan. Give a start: --start, --points, or markers; "
        "check --units.");
  GlobalRegistration found;
  LIMN_TRY(found.registration, refined_registration(mesh, index, scan, fits[0].fit.pose,
                                                    {.reach = 0.03,
                                                     .cell = options.cell,
                                                     .max_iterations = options.max_iterations,
                                                     .free_stddev_m = options.free_stddev_m}));
  for (std::size_t i = 1; i < fits.size() && !found.rival; ++i) {
    if (same_pose(fits[i].fit.pose, fits[0].fit.pose, patches[0].p, size)) continue;
    found.rival = fits[i].fit.pose;
    found.rival_share = static_cast<double>(fits[i].explained) / fits[0].explained;
  }
  return found;
}

}  // namespace limn::calib
