#include "calib/surface/registration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <opencv2/core.hpp>
#include <set>
#include <tuple>

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
constexpr int k_least_points = 30;    // for six parameters
constexpr double k_settled_m = 1e-7;  // step, at the mesh's radius
constexpr double k_held = 1e-6;       // share of the largest eigenvalue; below it rounding dominates
// RMS residual per step; below it, a form error of a tenth of a millimetre moves the fit by 3 mm.
constexpr double k_sensitive = 0.03;
constexpr double k_loose_m = 0.5e-3;  // standard deviation that deserves a warning
// Distance that counts as near, as a share of the mesh's diagonal and in metres, and the least shares of scan
// and mesh that are near where both are of one object.
constexpr double k_near = 0.01, k_least_near_m = 3e-3;
constexpr double k_least_scan_share = 0.25, k_least_mesh_share = 0.25;
constexpr double k_cluster = 1 / 20.0;  // share of the mesh's diagonal: errors within it count as shared

double diagonal(const std::vector<Eigen::Vector3f>& positions) {
  Eigen::AlignedBox3f box;
  for (const auto& p : positions) box.extend(p);
  return positions.empty() ? 0 : static_cast<double>(box.diagonal().norm());
}

struct ScanPoint {
  Vector3d p, n;
};

using Cell = std::array<int, 3>;
Cell cell_of(const Vector3d& p, double size) {
  return {static_cast<int>(std::floor(p.x() / size)), static_cast<int>(std::floor(p.y() / size)),
          static_cast<int>(std::floor(p.z() / size))};
}

// One point of each cell: the most accurate.
std::vector<ScanPoint> thinned(const scene::ScanSurface& scan, double cell) {
  std::map<Cell, std::size_t> chosen;
  for (std::size_t i = 0; i < scan.positions.size(); ++i) {
    if (!(scan.normals[i].squaredNorm() > 0.5f)) continue;
    const auto [at, fresh] = chosen.try_emplace(cell_of(scan.positions[i].cast<double>(), cell), i);
    if (!fresh && !scan.stddevs.empty() && scan.stddevs[i] < scan.stddevs[at->second]) at->second = i;
  }
  std::vector<ScanPoint> points;
  for (const auto& [at, i] : chosen)
    points.push_back({scan.positions[i].cast<double>(), scan.normals[i].cast<double>().normalized()});
  return points;
}

// Distance of a point (prototype frame) from the mesh along its normal; nullopt beyond its reach or its end.
struct Off {
  double distance = 0;
  Vector3d d_normal;
};
std::optional<Off> off_mesh(const scene::MeshBvh& index,
                            const Vector3d& p,
                            const Vector3d& d_facing,
                            double reach) {
  const auto nearest = index.nearest(p, reach, &d_facing, k_facing);
  if (!nearest) return std::nullopt;
  const Vector3d between = p - nearest->p;
  const double distance = nearest->d_normal.dot(between);
  const double sideways = (between - distance * nearest->d_normal).norm();
  if (sideways > k_sideways * std::abs(distance) + k_sideways_m) return std::nullopt;
  return Off{distance, nearest->d_normal};
}

struct Row {
  // Derivative of the residual by boxplus's perturbation with rotations about `pivot`, times radius.
  Vector6d jacobian;
  double residual = 0, weight = 1;
  double slope = 1;  // derivative of weight x residual by the residual
  Vector3d p;        // world
};

double median_size(const std::vector<Row>& rows) {
  std::vector<double> sizes;
  for (const Row& row : rows) sizes.push_back(std::abs(row.residual));
  return median(std::move(sizes));
}

// The frame and unit of rotations: about the centre of the points, in metres at their radius, so that all six
// parameters have the same unit.
struct Gauge {
  Vector3d pivot = Vector3d::Zero();
  double radius = 1;
};

Gauge gauge_of(const std::vector<Row>& rows) {
  Gauge gauge;
  for (const Row& row : rows) gauge.pivot += row.p / static_cast<double>(rows.size());
  double sum = 0;
  for (const Row& row : rows) sum += (row.p - gauge.pivot).squaredNorm();
  gauge.radius = std::max(1e-9, std::sqrt(sum / static_cast<double>(rows.size())));
  return gauge;
}

// Weighted residuals of the points near the mesh.
std::vector<Row> rows_at(const scene::MeshBvh& index,
                         const std::vector<ScanPoint>& points,
                         const Pose& world_from_prototype,
                         double reach) {
  const Pose inverse = world_from_prototype.inverse();
  std::vector<Row> all(points.size());
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
  std::vector<Row> rows;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (near[i]) rows.push_back(all[i]);
  return rows;
}

void add_rotations(const Gauge& gauge, std::vector<Row>* rows) {
  for (Row& row : *rows) {
    const Vector3d normal = -row.jacobian.tail<3>();
    row.jacobian.head<3>() = -(row.p - gauge.pivot).cross(normal) / gauge.radius;
  }
}

// Applies Tukey's weights; returns their scale.
double weigh(std::vector<Row>* rows) {
  const double scale = std::max(k_least_scale_m, 1.4826 * median_size(*rows));
  for (Row& row : *rows) {
    const double share = row.residual / (k_tukey * scale);
    const double rest = 1 - share * share;
    row.weight = rest > 0 ? rest * rest : 0;
    row.slope = rest > 0 ? rest * (1 - 5 * share * share) : 0;
  }
  return scale;
}

Matrix6d information_of(const std::vector<Row>& rows) {
  Matrix6d sum = Matrix6d::Zero();
  for (const Row& row : rows) sum += row.weight * row.jacobian * row.jacobian.transpose();
  return sum;
}

// The step that reduces the residuals, in the gauge; zero along free directions.
Vector6d step_of(const std::vector<Row>& rows) {
  Vector6d gradient = Vector6d::Zero();
  for (const Row& row : rows) gradient += row.weight * row.residual * row.jacobian;
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
Eigen::Matrix<double, 6, 6> delta_from_gauge(const Gauge& gauge, const Pose& world_from_prototype) {
  Matrix6d m = Matrix6d::Zero();
  m.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / gauge.radius;
  const Vector3d arm = world_from_prototype.translation - gauge.pivot;
  Eigen::Matrix3d cross;  // w x arm = -[arm]x w
  cross << 0, arm.z(), -arm.y(), -arm.z(), 0, arm.x(), arm.y(), -arm.x(), 0;
  m.bottomLeftCorner<3, 3>() = cross / gauge.radius;
  m.bottomRightCorner<3, 3>().setIdentity();
  return m;
}

Pose moved(const Pose& world_from_prototype, const Gauge& gauge, const Vector6d& step) {
  const Eigen::Quaterniond turn = exp_rotation(step.head<3>() / gauge.radius);
  return Pose(turn * world_from_prototype.rotation,
              gauge.pivot + turn * (world_from_prototype.translation - gauge.pivot) + step.tail<3>());
}

// The state of the fit.
struct Fitted {
  Pose pose;
  Gauge gauge;
  std::vector<Row> rows;
  double scale = 0;
  int iterations = 0;
};

std::optional<Fitted> fitted(const scene::MeshBvh& index,
                             const std::vector<ScanPoint>& points,
                             const Pose& start,
                             double reach,
                             int max_iterations) {
  constexpr double k_reach_scales = 8;  // in scales of the residuals: points beyond belong to something else
  // Smallest ratio of the reach from step to step: it must not shrink faster than the fit converges.
  constexpr double k_shrink = 0.8;
  constexpr double k_least_reach_m = 3e-3;
  Fitted fit;
  fit.pose = start;
  double now = reach;
  for (fit.iterations = 0; fit.iterations < max_iterations; ++fit.iterations) {
    fit.rows = rows_at(index, points, fit.pose, now);
    if (static_cast<int>(fit.rows.size()) < k_least_points) return std::nullopt;
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

// Cluster-robust (sandwich) covariance in the gauge, without free directions: from the scatter of the
// residuals' sums and the derivatives of these sums by a step (Huber 1967).
Matrix6d covariance_of(const Fitted& fit, double cluster, double free_stddev_m) {
  Matrix6d slopes = Matrix6d::Zero();
  for (const Row& row : fit.rows) slopes += row.slope * row.jacobian * row.jacobian.transpose();
  const EigenPairs6 eigen = eigen_pairs(slopes);
  std::map<Cell, Vector6d> sums;
  for (const Row& row : fit.rows) {
    const auto [at, fresh] = sums.try_emplace(cell_of(row.p, cluster), Vector6d::Zero());
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
std::vector<std::string> free_directions(const Fitted& fit, const Matrix6d& covariance) {
  const Matrix6d information = information_of(fit.rows);
  double weights = 0;
  for (const Row& row : fit.rows) weights += row.weight;
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

Registration alignment_of(const Fitted& fit, double mesh_diagonal, double free_stddev_m) {
  Registration result;
  result.world_from_prototype = fit.pose;
  const Matrix6d covariance = covariance_of(fit, k_cluster * mesh_diagonal, free_stddev_m);
  const Matrix6d out = delta_from_gauge(fit.gauge, fit.pose);
  result.covariance = out * covariance * out.transpose();
  result.free_directions = free_directions(fit, covariance);
  result.near = static_cast<int>(fit.rows.size());
  double sum = 0;
  for (const Row& row : fit.rows) {
    if (row.weight <= 0) continue;
    sum += row.residual * row.residual;
    ++result.used;
  }
  result.rms_m = std::sqrt(sum / std::max(1, result.used));
  result.iterations = fit.iterations;
  return result;
}

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
  return static_cast<int>(rows_at(index, points, pose, within).size());
}

struct Tried {
  Fitted fit;
  int explained = 0;
};

std::string size_text(double metres) {
  return metres < 1 ? fmt::format("{:.3g} mm", metres * 1e3) : fmt::format("{:.3g} m", metres);
}

}  // namespace

Result<Registration> refined_registration(const scene::Mesh& mesh,
                                          const scene::MeshBvh& index,
                                          const scene::ScanSurface& scan,
                                          const Pose& start,
                                          const RegistrationOptions& options) {
  const double size = diagonal(mesh.positions);
  const auto points = thinned(scan, options.cell * size);
  constexpr int k_goes = 3;
  // Reach of the next attempt as a share: far points slow down the last millimetres.
  constexpr double k_narrower = 0.25;
  double reach = options.reach * size;
  auto fit = fitted(index, points, start, reach, options.max_iterations);
  for (int go = 1; go < k_goes && fit && fit->iterations == options.max_iterations; ++go) {
    reach *= k_narrower;
    fit = fitted(index, points, fit->pose, reach, options.max_iterations);
  }
  if (!fit)
    return error(
        "expected at least {} scan points within {} of the mesh at the start that face the same way, found "
        "fewer. Check the start and the units; a mesh whose triangles are inside out does not fit.",
        k_least_points, size_text(options.reach * size));
  return alignment_of(*fit, size, options.free_stddev_m);
}

Result<Pose> pose_from_picks(const std::vector<Pick>& picks, double max_apart_m) {
  if (picks.size() < 3)
    return error("expected at least 3 picked pairs, found {}. Pick more, spread over the prototype.",
                 picks.size());
  Eigen::Matrix3Xd a(3, static_cast<Eigen::Index>(picks.size())), b = a;
  for (std::size_t i = 0; i < picks.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = picks[i].p_prototype;
    b.col(static_cast<Eigen::Index>(i)) = picks[i].p_world;
  }
  const Vector3d mean_a = a.rowwise().mean(), mean_b = b.rowwise().mean();
  const Eigen::Matrix3Xd da = a.colwise() - mean_a, db = b.colwise() - mean_b;
  for (const Eigen::Matrix3d& scatter :
       {Eigen::Matrix3d(da * da.transpose()), Eigen::Matrix3d(db * db.transpose())}) {
    const Eigen::Vector3d squares = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvalues();
    if (!(std::sqrt(std::max(0.0, squares[1])) > 0.02 * std::sqrt(squares[2])))
      return error(
          "the picked points lie on one line: the rotation about it is undetermined. Pick a point beside "
          "it.");
  }
  const Eigen::Matrix3d rotation = nearest_rotation(db * da.transpose());
  const Pose pose(rotation, mean_b - rotation * mean_a);
  Eigen::Index worst = 0;
  const double apart = (b - ((rotation * a).colwise() + pose.translation)).colwise().norm().maxCoeff(&worst);
  if (apart > max_apart_m)
    return error(
        "pair {}: after the best fit of all {} pairs its points are {:.0f} mm apart. Check this pair, the "
        "order, and the units of the CAD points.",
        worst, picks.size(), 1e3 * apart);
  return pose;
}

Status comparable_sizes(const scene::Mesh& mesh, const scene::ScanSurface& scan) {
  constexpr double k_plausible = 50;  // ratio; a wrong unit gives 25 or more, a room around a part less
  const double cad = diagonal(mesh.positions), seen = diagonal(scan.positions);
  if (!(cad > 0) || !(seen > 0))
    return error("expected a mesh and a scan with extent, found sizes {} m and {} m.", cad, seen);
  const double ratio = cad / seen;
  if (ratio < k_plausible && ratio > 1 / k_plausible) return {};
  const bool larger = ratio > 1;
  const double factor = larger ? ratio : 1 / ratio;
  // A round factor when a unit explains it: a scan is one to some times as large as the prototype.
  const bool thousand = factor > 150 && factor < 5000;
  return error("the CAD is {} times {} than the scan ({} against {}): check --units.",
               thousand ? std::string("about 1000") : fmt::format("{:.0f}", factor),
               larger ? "larger" : "smaller", size_text(cad), size_text(seen));
}

Result<GlobalRegistration> global_registration(const scene::Mesh& mesh,
                                               const scene::MeshBvh& index,
                                               const scene::ScanSurface& scan,
                                               const RegistrationOptions& options) {
  constexpr std::size_t k_pieces = 4, k_short_points = 160, k_long_points = 600, k_long = 4;
  constexpr int k_short_steps = 15;
  // Share of the mesh's diagonal; a larger piece is a wall.
  constexpr double k_largest = 1.3, k_smallest = 0.2;
  const double size = diagonal(mesh.positions);
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
    const double extent = diagonal(part.positions);
    if (!pieces.areas.empty() && (extent > k_largest * size || extent < k_smallest * size)) continue;
    const auto points = every(thinned(part, options.cell * size), k_long_points);
    if (static_cast<int>(points.size()) < 4 * k_least_points) continue;
    const auto some = every(points, k_short_points);
    std::vector<PlacedCandidate> shorts;
    for (const PlacedCandidate& candidate : coarse_poses(patches, field, points, size)) {
      const auto fit = fitted(index, some, candidate.pose, 0.15 * size, k_short_steps);
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
      auto fit = fitted(index, points, candidate.pose, 0.05 * size, options.max_iterations);
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
  const double size = diagonal(mesh.positions), cell = options.cell * size;
  out.near_m = std::max(k_least_near_m, k_near * size);
  const auto points = thinned(scan, cell);
  out.scan_points = static_cast<int>(points.size());
  const std::vector<Row> rows = rows_at(index, points, world_from_prototype, out.near_m);
  out.scan_share = static_cast<double>(rows.size()) / std::max(1, out.scan_points);

  // The mesh's area by cells of the same size, and which of them have a scan point.
  std::set<Cell> scanned;
  const Pose inverse = world_from_prototype.inverse();
  for (const Row& row : rows)
    if (const auto nearest = index.nearest(inverse * row.p, 2 * out.near_m))
      scanned.insert(cell_of(nearest->p, 2 * cell));
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
      if (scanned.contains(cell_of(a + u * ab + v * ac, 2 * cell))) near += own / places;
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
