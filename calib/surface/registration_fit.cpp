#include "calib/surface/registration_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/core.hpp>

#include "core/linear_algebra.h"
#include "core/log.h"
#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector3d;

constexpr double k_facing = 0.5;  // cosine; scan and mesh face the same way within 60 degrees
// Scale of the residuals; below it weights would depend on rounding.
constexpr double k_least_scale_m = 20e-6;
constexpr double k_tukey = 4.685;  // 95 % efficient for normal residuals
// Share of a residual: a point further off along the surface lies beyond the mesh's end.
constexpr double k_sideways = 0.5;
constexpr double k_sideways_m = 0.5e-3;
constexpr double k_settled_m = 1e-7;  // step, at the mesh's radius
constexpr double k_held = 1e-6;       // share of the largest eigenvalue; below it rounding dominates
// RMS residual per step; below it, a form error of a tenth of a millimetre moves the fit by 3 mm.
constexpr double k_sensitive = 0.03;
constexpr double k_loose_m = 0.5e-3;    // standard deviation that deserves a warning
constexpr double k_cluster = 1 / 20.0;  // share of the mesh's diagonal: errors within it count as shared

double median_size(const std::vector<FitRow>& rows) {
  std::vector<double> sizes;
  for (const FitRow& row : rows) sizes.push_back(std::abs(row.residual));
  return median(std::move(sizes));
}

FitGauge gauge_of(const std::vector<FitRow>& rows) {
  FitGauge gauge;
  for (const FitRow& row : rows) gauge.pivot += row.p / static_cast<double>(rows.size());
  double sum = 0;
  for (const FitRow& row : rows) sum += (row.p - gauge.pivot).squaredNorm();
  gauge.radius = std::max(1e-9, std::sqrt(sum / static_cast<double>(rows.size())));
  return gauge;
}

void add_rotations(const FitGauge& gauge, std::vector<FitRow>* rows) {
  for (FitRow& row : *rows) {
    const Vector3d normal = -row.jacobian.tail<3>();
    row.jacobian.head<3>() = -(row.p - gauge.pivot).cross(normal) / gauge.radius;
  }
}

// Applies Tukey's weights; returns their scale.
double weigh(std::vector<FitRow>* rows) {
  const double scale = std::max(k_least_scale_m, 1.4826 * median_size(*rows));
  for (FitRow& row : *rows) {
    const double share = row.residual / (k_tukey * scale);
    const double rest = 1 - share * share;
    row.weight = rest > 0 ? rest * rest : 0;
    row.slope = rest > 0 ? rest * (1 - 5 * share * share) : 0;
  }
  return scale;
}

Matrix6d information_of(const std::vector<FitRow>& rows) {
  Matrix6d sum = Matrix6d::Zero();
  for (const FitRow& row : rows) sum += row.weight * row.jacobian * row.jacobian.transpose();
  return sum;
}

// The step that reduces the residuals, in the gauge; zero along free directions.
Vector6d step_of(const std::vector<FitRow>& rows) {
  Vector6d gradient = Vector6d::Zero();
  for (const FitRow& row : rows) gradient += row.weight * row.residual * row.jacobian;
  const EigenPairs6 eigen = eigen_pairs(information_of(rows));
  Vector6d step = Vector6d::Zero();
  for (int i = 0; i < 6; ++i) {
    if (eigen.values[i] < k_held * eigen.values[5]) continue;
    const Vector6d d = eigen.vectors.col(i);
    step -= d.dot(gradient) / eigen.values[i] * d;
  }
  return step;
}

// boxplus's perturbation of a step in the gauge: the rotation about the pivot also moves the prototype's
// origin.
Eigen::Matrix<double, 6, 6> delta_from_gauge(const FitGauge& gauge, const Pose& world_from_prototype) {
  Matrix6d m = Matrix6d::Zero();
  m.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / gauge.radius;
  const Vector3d arm = world_from_prototype.translation - gauge.pivot;
  Eigen::Matrix3d cross;  // w x arm = -[arm]x w
  cross << 0, arm.z(), -arm.y(), -arm.z(), 0, arm.x(), arm.y(), -arm.x(), 0;
  m.bottomLeftCorner<3, 3>() = cross / gauge.radius;
  m.bottomRightCorner<3, 3>().setIdentity();
  return m;
}

Pose moved(const Pose& world_from_prototype, const FitGauge& gauge, const Vector6d& step) {
  const Eigen::Quaterniond turn = exp_rotation(step.head<3>() / gauge.radius);
  return Pose(turn * world_from_prototype.rotation,
              gauge.pivot + turn * (world_from_prototype.translation - gauge.pivot) + step.tail<3>());
}

// Cluster-robust (sandwich) covariance in the gauge, without free directions: from the scatter of the
// residuals' sums and the derivatives of these sums by a step (Huber 1967).
Matrix6d covariance_of(const RegistrationFit& fit, double cluster, double free_stddev_m) {
  Matrix6d slopes = Matrix6d::Zero();
  for (const FitRow& row : fit.rows) slopes += row.slope * row.jacobian * row.jacobian.transpose();
  const EigenPairs6 eigen = eigen_pairs(slopes);
  std::map<ScanCell, Vector6d> sums;
  for (const FitRow& row : fit.rows) {
    const auto [at, fresh] = sums.try_emplace(scan_cell_of(row.p, cluster), Vector6d::Zero());
    at->second += row.weight * row.residual * row.jacobian;
  }
  Matrix6d middle = Matrix6d::Zero();
  for (const auto& [cell, g] : sums) middle += g * g.transpose();
  const auto clusters = static_cast<double>(sums.size());
  middle *= clusters / std::max(1.0, clusters - 6);
  Matrix6d inverse = Matrix6d::Zero(), free = Matrix6d::Zero();
  for (int i = 0; i < 6; ++i) {
    const Vector6d d = eigen.vectors.col(i);
    if (eigen.values[i] < k_held * eigen.values[5])
      free += free_stddev_m * free_stddev_m * d * d.transpose();
    else
      inverse += d * d.transpose() / eigen.values[i];
  }
  return inverse * middle * inverse + free;
}

std::string axis_text(const Vector3d& d) {
  constexpr double k_along = 0.97;
  for (int axis = 0; axis < 3; ++axis)
    if (std::abs(d[axis]) > k_along) return std::string(1, "xyz"[axis]);
  return fmt::format("({:.2f}, {:.2f}, {:.2f})", d.x(), d.y(), d.z());
}

// Directions of a subspace within the first (offset 0: rotations) or the last three (3: translations)
// parameters.
std::vector<Vector3d> pure(const Eigen::MatrixXd& space, int offset) {
  constexpr double k_pure = 0.9;
  const Eigen::MatrixXd part = space.middleRows(offset, 3);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(Eigen::Matrix3d(part * part.transpose()));
  std::vector<Vector3d> found;
  for (int i = 0; i < 3; ++i)
    if (eigen.eigenvalues()[i] > k_pure) found.push_back(eigen.eigenvectors().col(i));
  return found;
}

// Directions that the points' normals do not determine, or only weakly, named in the prototype's frame.
std::vector<std::string> free_directions(const RegistrationFit& fit, const Matrix6d& covariance) {
  const Matrix6d information = information_of(fit.rows);
  double weights = 0;
  for (const FitRow& row : fit.rows) weights += row.weight;
  const EigenPairs6 eigen = eigen_pairs(information);
  std::vector<Vector6d> loose;
  for (int i = 0; i < 6; ++i) {
    const Vector6d d = eigen.vectors.col(i);
    const double sensitivity = std::sqrt(std::max(0.0, eigen.values[i]) / weights);
    if (sensitivity < k_sensitive || std::sqrt(d.dot(covariance * d)) > k_loose_m) loose.push_back(d);
  }
  Eigen::MatrixXd space(6, static_cast<Eigen::Index>(loose.size()));
  for (std::size_t i = 0; i < loose.size(); ++i) space.col(static_cast<Eigen::Index>(i)) = loose[i];
  const Eigen::Quaterniond prototype_from_world = fit.pose.rotation.conjugate();
  std::vector<std::string> names;
  if (loose.empty()) return names;
  for (const Vector3d& d : pure(space, 3))
    names.push_back("slide along " + axis_text(prototype_from_world * d));
  for (const Vector3d& d : pure(space, 0))
    names.push_back("turn about " + axis_text(prototype_from_world * d));
  for (std::size_t i = 0; i < loose.size() && names.size() < loose.size(); ++i) {
    const Vector3d turn = prototype_from_world * loose[i].head<3>(),
                   slide = prototype_from_world * loose[i].tail<3>();
    if (turn.norm() > 0.95 || slide.norm() > 0.95) continue;  // already named
    names.push_back(fmt::format("turn about {} with a slide along {}", axis_text(turn.normalized()),
                                axis_text(slide.normalized())));
  }
  return names;
}

}  // namespace

double diagonal_of(const std::vector<Eigen::Vector3f>& positions) {
  Eigen::AlignedBox3f box;
  for (const auto& p : positions) box.extend(p);
  return positions.empty() ? 0 : static_cast<double>(box.diagonal().norm());
}

ScanCell scan_cell_of(const Vector3d& p, double size) {
  return {static_cast<int>(std::floor(p.x() / size)), static_cast<int>(std::floor(p.y() / size)),
          static_cast<int>(std::floor(p.z() / size))};
}

std::vector<ScanPoint> thinned(const scene::ScanSurface& scan, double cell) {
  std::map<ScanCell, std::size_t> chosen;
  for (std::size_t i = 0; i < scan.positions.size(); ++i) {
    if (!(scan.normals[i].squaredNorm() > 0.5f)) continue;
    const auto [at, fresh] = chosen.try_emplace(scan_cell_of(scan.positions[i].cast<double>(), cell), i);
    if (!fresh && !scan.stddevs.empty() && scan.stddevs[i] < scan.stddevs[at->second]) at->second = i;
  }
  std::vector<ScanPoint> points;
  for (const auto& [at, i] : chosen)
    points.push_back({scan.positions[i].cast<double>(), scan.normals[i].cast<double>().normalized()});
  return points;
}

std::optional<MeshOffset> off_mesh(const scene::MeshBvh& index,
                                   const Vector3d& p,
                                   const Vector3d& d_facing,
                                   double reach) {
  const auto nearest = index.nearest(p, reach, &d_facing, k_facing);
  if (!nearest) return std::nullopt;
  const Vector3d between = p - nearest->p;
  const double distance = nearest->d_normal.dot(between);
  const double sideways = (between - distance * nearest->d_normal).norm();
  if (sideways > k_sideways * std::abs(distance) + k_sideways_m) return std::nullopt;
  return MeshOffset{distance, nearest->d_normal};
}

std::string size_text(double metres) {
  return metres < 1 ? fmt::format("{:.3g} mm", metres * 1e3) : fmt::format("{:.3g} m", metres);
}

std::vector<FitRow> fit_rows(const scene::MeshBvh& index,
                             const std::vector<ScanPoint>& points,
                             const Pose& world_from_prototype,
                             double reach) {
  const Pose inverse = world_from_prototype.inverse();
  std::vector<FitRow> all(points.size());
  std::vector<std::uint8_t> near(points.size(), 0);
  cv::parallel_for_(cv::Range(0, static_cast<int>(points.size())), [&](const cv::Range& range) {
    for (int k = range.start; k < range.end; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const auto off = off_mesh(index, inverse * points[i].p, inverse.rotation * points[i].n, reach);
      if (!off) continue;
      near[i] = 1;
      all[i].residual = off->distance;
      all[i].p = points[i].p;
      all[i].jacobian.tail<3>() = -(world_from_prototype.rotation * off->d_normal);
    }
  });
  std::vector<FitRow> rows;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (near[i]) rows.push_back(all[i]);
  return rows;
}

std::optional<RegistrationFit> fit_registration(const scene::MeshBvh& index,
                                                const std::vector<ScanPoint>& points,
                                                const Pose& start,
                                                double reach,
                                                int max_iterations) {
  constexpr double k_reach_scales = 8;  // in scales of the residuals: points beyond belong to something else
  // Smallest ratio of the reach from step to step: it must not shrink faster than the fit converges.
  constexpr double k_shrink = 0.8;
  constexpr double k_least_reach_m = 3e-3;
  RegistrationFit fit;
  fit.pose = start;
  double now = reach;
  for (fit.iterations = 0; fit.iterations < max_iterations; ++fit.iterations) {
    fit.rows = fit_rows(index, points, fit.pose, now);
    if (static_cast<int>(fit.rows.size()) < k_least_fit_points) return std::nullopt;
    fit.gauge = gauge_of(fit.rows);
    add_rotations(fit.gauge, &fit.rows);
    fit.scale = weigh(&fit.rows);
    const Vector6d step = step_of(fit.rows);
    if (!step.allFinite()) return std::nullopt;
    const double next =
        std::max({k_least_reach_m, k_shrink * now, std::min(now, k_reach_scales * fit.scale)});
    const bool settled = step.norm() < k_settled_m && next >= now;
    if (settled) break;
    fit.pose = moved(fit.pose, fit.gauge, step);
    now = std::min(now, next);
  }
  return fit;
}

Registration registration_of(const RegistrationFit& fit, double mesh_diagonal, double free_stddev_m) {
  Registration result;
  result.world_from_prototype = fit.pose;
  const Matrix6d covariance = covariance_of(fit, k_cluster * mesh_diagonal, free_stddev_m);
  const Matrix6d out = delta_from_gauge(fit.gauge, fit.pose);
  result.covariance = out * covariance * out.transpose();
  result.free_directions = free_directions(fit, covariance);
  result.near = static_cast<int>(fit.rows.size());
  double sum = 0;
  for (const FitRow& row : fit.rows) {
    if (row.weight <= 0) continue;
    sum += row.residual * row.residual;
    ++result.used;
  }
  result.rms_m = std::sqrt(sum / std::max(1, result.used));
  result.iterations = fit.iterations;
  return result;
}

}  // namespace limn::calib
