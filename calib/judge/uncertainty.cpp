#include "calib/judge/uncertainty.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "calib/measurement_model.h"

namespace limn::calib {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_moved_m = 0.15;
constexpr double k_turned = 40 * std::numbers::pi / 180;
constexpr int k_panel_grid = 9;  // points along each side of the panel
// Share of its width and height: prototypes are lit with some margin.
constexpr double k_panel_share = 0.75;
constexpr double k_relief_m = 0.03;  // relief of the target, to both sides
// Minimum number of points for a camera to measure a target's pose.
constexpr int k_least_points = 6;
constexpr size_t k_measured_points = 24;  // the corners of six markers
constexpr double k_least_measured_px =
    0.02;  // noise of markers' corners: 0.01 to 0.03 px (limn bench tracker)
// 70 degrees: nobody looks for a part on surfaces lit at a more grazing angle.
constexpr double k_least_cosine = 0.34;
constexpr double k_stated_share = 0.95;

Matrix3d cross(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// The pixel of a world point in an imager, and its derivatives.
struct ProjectedPoint {
  Vector2d px;
  Eigen::Matrix<double, 2, 3> by_point;   // derivative by the point, world axes
  Eigen::Matrix<double, 2, 6> by_imager;  // derivative by the imager's pose (boxplus's perturbation)
  Derivatives::Values by_values;
};

std::optional<ProjectedPoint> project_with_derivatives(const Imager& imager, const Vector3d& p_world) {
  const Vector3d p = imager.imager_from_world * p_world;
  if (!imager.lens.project(p)) return std::nullopt;  // project() detects where a polynomial has folded back
  ProjectedPoint seen;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_p;
  seen.by_values.resize(2, imager.lens.model.value_count());
  if (!imager.lens.model.project(imager.lens.values, p, &seen.px, by_p.data(), seen.by_values.data()) ||
      !imager.contains(seen.px))
    return std::nullopt;
  seen.by_point = by_p * imager.imager_from_world.rotation_matrix();
  seen.by_imager << -by_p * cross(imager.imager_from_world.rotation * p_world), by_p;
  return seen;
}

// Derivatives of a target's pose, as a camera measures it (rotation about `centre`, then translation), by the
// camera's values and pose and by the measured pixels' noise.
struct Placed {
  size_t camera = 0;  // the one that measures
  Vector3d centre;
  MatrixXd by_values;         // 6 x value count
  Matrix6d by_camera;         // derivative by the camera's pose
  Matrix6d noise_covariance;  // covariance for a noise of 1 px^2
  int points = 0;             // the target's points that the camera sees
};

std::optional<Placed> placed(const Imager& camera, const RigidTarget& thing) {
  Placed placed;
  placed.centre.setZero();
  for (const Vector3d& p : thing) placed.centre += p / static_cast<double>(thing.size());
  Matrix6d normal = Matrix6d::Zero(), by_camera = Matrix6d::Zero();
  MatrixXd by_values = MatrixXd::Zero(6, camera.lens.model.value_count());
  int points = 0;
  for (const Vector3d& p : thing) {
    const auto seen = project_with_derivatives(camera, p);
    if (!seen) continue;
    Eigen::Matrix<double, 2, 6> by_pose;
    by_pose << -seen->by_point * cross(p - placed.centre), seen->by_point;
    normal += by_pose.transpose() * by_pose;
    by_values += by_pose.transpose() * seen->by_values;
    by_camera += by_pose.transpose() * seen->by_imager;
    ++points;
  }
  if (points < k_least_points) return std::nullopt;
  placed.points = points;
  const Vector6d scale = normal.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix6d scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  if (!scaled.allFinite() || scaled.determinant() < 1e-12) return std::nullopt;
  placed.noise_covariance = scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
  placed.by_values = -placed.noise_covariance * by_values;
  placed.by_camera = -placed.noise_covariance * by_camera;
  return placed;
}

// By the camera that sees most of the target; of several, by the first.
std::optional<Placed> placed_by_best(const Rig& rig, const RigidTarget& thing) {
  std::optional<Placed> best;
  for (size_t camera = 0; camera < rig.cameras.size(); ++camera) {
    auto tried = placed(rig.cameras[camera], thing);
    if (!tried || (best && tried->points <= best->points)) continue;
    tried->camera = camera;
    best = std::move(tried);
  }
  return best;
}

std::optional<Eigen::Matrix2d> light_covariance(const Solution& solution,
                                                const Uncertainty& uncertainty,
                                                const Placed& thing,
                                                size_t projector,
                                                const SurfaceTarget& place) {
  const Imager& light = solution.rig.projectors[projector];
  const auto seen = project_with_derivatives(light, place.p_world);
  const Vector3d p_light = light.imager_from_world.inverse().translation;
  const Vector3d p_eye = solution.rig.cameras[thing.camera].imager_from_world.inverse().translation;
  if (!seen) return std::nullopt;
  const double towards_light = place.n_world.dot((p_light - place.p_world).normalized());
  if (std::abs(towards_light) < k_least_cosine ||
      towards_light * place.n_world.dot(p_eye - place.p_world) < 0)
    return std::nullopt;  // grazing light, or light on the side that the camera does not see
  Eigen::Matrix<double, 2, 6> by_thing;
  by_thing << -seen->by_point * cross(place.p_world - thing.centre), seen->by_point;
  MatrixXd by_unknowns = MatrixXd::Zero(2, uncertainty.covariance.cols());
  const Eigen::Index camera_values = thing.by_values.cols(), values = seen->by_values.cols();
  const int at = solution.projector_at(projector);
  const int camera_at = solution.camera_at(thing.camera);
  by_unknowns.middleCols(camera_at, camera_values) = by_thing * thing.by_values;
  by_unknowns.middleCols(camera_at + camera_values, 6) = by_thing * thing.by_camera;
  by_unknowns.middleCols(at, values) = seen->by_values;
  by_unknowns.middleCols(at + values, 6) = seen->by_imager;
  // Derivative of projector pixels by metres on the surface.
  const Vector3d u = place.n_world.unitOrthogonal(), v = place.n_world.cross(u);
  Eigen::Matrix2d px_by_m;
  px_by_m << seen->by_point * u, seen->by_point * v;
  if (std::abs(px_by_m.determinant()) < 1e-6) return std::nullopt;  // grazing light
  const Eigen::Matrix2d m_by_px = px_by_m.inverse();
  const Eigen::Matrix2d px_covariance = by_unknowns * uncertainty.covariance * by_unknowns.transpose() +
                                        uncertainty.measured_px * uncertainty.measured_px * by_thing *
                                            thing.noise_covariance * by_thing.transpose();
  return m_by_px * px_covariance * m_by_px.transpose();
}

// A target that fills the middle of the projector's panel at the boards' distance, as far as the camera sees
// it: points of a sheet with some relief, facing the middle between the two devices. It does not depend on
// where the boards stood, so that a rig whose boards stayed in the middle is judged at the panel's edges,
// too.
std::vector<SurfaceTarget> panel_places(const Solution& solution,
                                        const Board& board,
                                        size_t projector,
                                        size_t by_camera) {
  const Imager &camera = solution.rig.cameras[by_camera], &light = solution.rig.projectors[projector];
  Vector3d p_boards = Vector3d::Zero();
  int boards = 0;
  for (const auto& world_from_board : solution.world_from_board) {
    if (!world_from_board) continue;
    p_boards += *world_from_board * Vector3d(board.width_m() / 2, board.height_m() / 2, 0);
    ++boards;
  }
  p_boards /= std::max(1, boards);
  const Vector3d p_eyes =
      (camera.imager_from_world.inverse().translation + light.imager_from_world.inverse().translation) / 2;
  const Vector3d n = (p_boards - p_eyes).normalized();
  const auto on_panel = [](int step) { return k_panel_share * ((step + 0.5) / k_panel_grid - 0.5); };
  std::vector<SurfaceTarget> places;
  for (int i = 0; i < k_panel_grid * k_panel_grid; ++i) {
    const int column = i % k_panel_grid, row = i / k_panel_grid;
    const auto ray =
        light.ray({(0.5 + on_panel(column)) * light.width - 0.5, (0.5 + on_panel(row)) * light.height - 0.5});
    if (!ray || n.dot(ray->d) <= 0) continue;
    const double relief = (column + row) % 2 == 0 ? k_relief_m : -k_relief_m;
    const Vector3d p = ray->p_origin + ray->d * ((n.dot(p_boards - ray->p_origin) + relief) / n.dot(ray->d));
    if (project_with_derivatives(camera, p)) places.push_back({p, n});
  }
  return places;
}

// The targets on the panel, for each camera: those places that no camera before it sees. A camera that adds
// little to those before it gets none.
std::vector<std::vector<SurfaceTarget>> panel_targets(const Solution& solution,
                                                      const Board& board,
                                                      size_t projector) {
  constexpr double k_least_share = 0.2;  // share of the panel's places
  const auto& cameras = solution.rig.cameras;
  std::vector<std::vector<SurfaceTarget>> targets;
  for (size_t camera = 0; camera < cameras.size(); ++camera) {
    std::vector<SurfaceTarget> places = panel_places(solution, board, projector, camera);
    std::erase_if(places, [&](const SurfaceTarget& place) {
      return std::any_of(
          cameras.begin(), cameras.begin() + static_cast<std::ptrdiff_t>(camera),
          [&](const Imager& before) { return project_with_derivatives(before, place.p_world); });
    });
    if (camera > 0 && static_cast<double>(places.size()) < k_least_share * k_panel_grid * k_panel_grid)
      places.clear();
    targets.push_back(std::move(places));
  }
  return targets;
}

// Selects points that the camera sees, as far apart as possible: each is the farthest from those before.
RigidTarget measured_points(const Imager& camera, const std::vector<SurfaceTarget>& places) {
  std::vector<std::pair<Vector3d, double>> left;  // each with its distance to the nearest chosen point
  for (const SurfaceTarget& place : places) {
    if (project_with_derivatives(camera, place.p_world))
      left.emplace_back(place.p_world, std::numeric_limits<double>::infinity());
  }
  RigidTarget chosen;
  while (chosen.size() < std::min(k_measured_points, left.size())) {
    const auto farthest = std::max_element(left.begin(), left.end(),
                                           [](const auto& a, const auto& b) { return a.second < b.second; });
    chosen.push_back(farthest->first);
    for (auto& [p, distance] : left) distance = std::min(distance, (p - chosen.back()).norm());
  }
  return chosen;
}

// Motions of the target: none, translations in each direction, rotations about its middle
// (world_from_before).
std::array<std::vector<Pose>, 3> placements(const std::vector<SurfaceTarget>& places) {
  Vector3d centre = Vector3d::Zero();
  for (const SurfaceTarget& place : places) centre += place.p_world / static_cast<double>(places.size());
  std::array<std::vector<Pose>, 3> all = {{{Pose()}, {}, {}}};
  for (const double sign : {-1.0, 1.0}) {
    for (int axis = 0; axis < 3; ++axis)
      all[1].emplace_back(Eigen::Quaterniond::Identity(), sign * k_moved_m * Vector3d::Unit(axis));
    for (int axis = 0; axis < 2; ++axis) {
      const Pose turned(exp_rotation(sign * k_turned * Vector3d::Unit(axis)), Vector3d::Zero());
      all[2].push_back(Pose(Eigen::Quaterniond::Identity(), centre) * turned *
                       Pose(Eigen::Quaterniond::Identity(), -centre));
    }
  }
  return all;
}

std::vector<SurfaceTarget> placed_anew(const Pose& world_from_before, std::vector<SurfaceTarget> places) {
  for (SurfaceTarget& place : places) {
    place.p_world = world_from_before * place.p_world;
    place.n_world = world_from_before.rotation * place.n_world;
  }
  return places;
}

// Differences of the devices' parameters between two rigs; empty when the lens models differ.
Eigen::VectorXd unknowns_between(const Rig& rig, const Rig& from) {
  std::vector<double> values;
  for (const auto devices : {&Rig::cameras, &Rig::projectors}) {
    if ((rig.*devices).size() != (from.*devices).size()) return {};
    for (size_t i = 0; i < (rig.*devices).size(); ++i) {
      const Imager &a = (rig.*devices)[i], &b = (from.*devices)[i];
      if (!(a.lens.model == b.lens.model)) return {};
      for (size_t k = 0; k < a.lens.values.size(); ++k) values.push_back(a.lens.values[k] - b.lens.values[k]);
      const Vector6d pose = boxminus(a.imager_from_world, b.imager_from_world);
      values.insert(values.end(), pose.data(), pose.data() + 6);
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

// The jackknife over the poses that are not odd, and what it would be if the observations' errors were
// independent: without a pose, an estimate moves by the difference of the two estimates' covariances.
struct Jackknife {
  MatrixXd found, expected;
};

Jackknife jackknife_of_even_poses(const Observations& observations,
                                  const Solution& solution,
                                  const SolveOptions& options,
                                  const CrossValidation& held_out) {
  std::set<size_t> odd;
  for (const OddPose& pose : odd_poses(held_out)) odd.insert(pose.index);
  const Eigen::Index size = solution.covariance.cols();
  std::vector<Rig> without;
  MatrixXd expected = MatrixXd::Zero(size, size);
  for (size_t i = 0; i < held_out.rigs.size(); ++i) {
    if (odd.contains(i)) continue;
    without.push_back(with_distortion_values(held_out.rigs[i]));
    const auto& names = observations.poses;
    const auto pose = std::find(names.begin(), names.end(), held_out.poses[i].pose) - names.begin();
    expected +=
        covariance_without(observations, solution, options, static_cast<int>(pose)) - solution.covariance;
  }
  const auto n = static_cast<double>(without.size());
  return {jackknife_covariance(solution, without), (n - 1) / std::max(n, 1.0) * expected};
}

// Ratio of the variances of errors (mm, one for each projector) that two covariances predict; 1 where
// unknown.
double ratio_of_variances(const std::vector<double>& above_mm, const std::vector<double>& below_mm) {
  double above = 0, below = 0;
  for (size_t i = 0; i < above_mm.size(); ++i) {
    if (!std::isfinite(above_mm[i]) || !std::isfinite(below_mm[i])) continue;
    above += above_mm[i] * above_mm[i];
    below += below_mm[i] * below_mm[i];
  }
  return below > 0 ? above / below : 1;
}

}  // namespace

Eigen::MatrixXd jackknife_covariance(const Solution& solution, std::span<const Rig> without) {
  std::vector<Eigen::VectorXd> moved;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(solution.covariance.cols());
  for (const Rig& rig : without) {
    const Eigen::VectorXd delta = unknowns_between(rig, solution.rig);
    if (delta.size() != mean.size()) continue;
    moved.push_back(delta);
    mean += delta;
  }
  MatrixXd covariance = MatrixXd::Zero(mean.size(), mean.size());
  const auto n = static_cast<double>(moved.size());
  if (n < 3) return covariance;
  mean /= n;
  for (const Eigen::VectorXd& delta : moved)
    covariance += (n - 1) / n * (delta - mean) * (delta - mean).transpose();
  return covariance;
}

std::vector<std::optional<Eigen::Matrix2d>> light_covariances(const Solution& solution,
                                                              const Uncertainty& uncertainty,
                                                              const RigidTarget& thing,
                                                              size_t projector,
                                                              std::span<const SurfaceTarget> places) {
  std::vector<std::optional<Eigen::Matrix2d>> covariances(places.size());
  const auto measured = placed_by_best(solution.rig, thing);
  if (!measured) return covariances;
  for (size_t i = 0; i < places.size(); ++i)
    covariances[i] = light_covariance(solution, uncertainty, *measured, projector, places[i]);
  return covariances;
}

double p95_of(std::span<const std::vector<Eigen::Matrix2d>> groups) {
  // A 2D normal distribution in polar coordinates of its unit circle: the radius is Rayleigh in each
  // direction. This many angles over a quarter turn give shares accurate to 1e-4 for any shape.
  constexpr int k_angles = 16;
  std::vector<std::pair<double, double>> rays;  // variance, weight
  double largest = 0, total = 0;
  for (const auto& group : groups) {
    for (const Eigen::Matrix2d& covariance : group) {
      const Vector2d variances = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>()
                                     .computeDirect(covariance, Eigen::EigenvaluesOnly)
                                     .eigenvalues()
                                     .cwiseMax(0.0);
      const double weight = 1.0 / (k_angles * static_cast<double>(group.size()));
      for (int i = 0; i < k_angles; ++i) {
        const double c = std::cos((i + 0.5) / k_angles * std::numbers::pi / 2);
        rays.emplace_back(variances[0] * c * c + variances[1] * (1 - c * c), weight);
      }
      largest = std::max(largest, variances[1]);
      total += weight * k_angles;
    }
  }
  if (rays.empty()) return std::numeric_limits<double>::infinity();
  double low = 0, high = 10 * std::sqrt(largest);
  constexpr int k_halvings = 40;
  for (int i = 0; i < k_halvings; ++i) {
    const double middle = (low + high) / 2;
    double share = 0;
    for (const auto& [variance, weight] : rays)
      share += weight * (variance > 0 ? -std::expm1(-middle * middle / (2 * variance)) : 1.0);
    (share < k_stated_share * total ? low : high) = middle;
  }
  return high;
}

std::vector<double> propagated_error_mm(const Observations& observations,
                                        const Solution& solution,
                                        const Uncertainty& uncertainty) {
  std::vector<double> p95;
  for (size_t projector = 0; projector < solution.rig.projectors.size(); ++projector) {
    const auto targets = panel_targets(solution, observations.board, projector);
    std::array<std::vector<Eigen::Matrix2d>, 3> groups;
    for (size_t camera = 0; camera < targets.size(); ++camera) {
      if (targets[camera].empty()) continue;
      const auto all = placements(targets[camera]);
      for (size_t group = 0; group < groups.size(); ++group) {
        for (const Pose& world_from_before : all[group]) {
          const std::vector<SurfaceTarget> places = placed_anew(world_from_before, targets[camera]);
          const RigidTarget thing = measured_points(solution.rig.cameras[camera], places);
          for (const auto& covariance : light_covariances(solution, uncertainty, thing, projector, places)) {
            if (covariance) groups[group].push_back(*covariance);
          }
        }
      }
    }
    p95.push_back(1e3 * p95_of(groups));
  }
  return p95;
}

Uncertainty estimated_uncertainty(const Observations& observations,
                                  const Solution& solution,
                                  const SolveOptions& options,
                                  const CrossValidation& held_out) {
  const auto mm = [&](const MatrixXd& covariance) {
    return propagated_error_mm(observations, solution, {covariance, 0});
  };
  std::vector<Rig> without;
  for (const Rig& rig : held_out.rigs) without.push_back(with_distortion_values(rig));
  const auto scatter = mm(solution.covariance), jackknife = mm(jackknife_covariance(solution, without));
  // Where poses have errors of their own, the covariance from scatter is too small by up to a factor of 2 and
  // the jackknife's too large by as much: the geometric mean is used.
  double variance = 1;
  for (size_t i = 0; i < scatter.size(); ++i) {
    if (std::isfinite(jackknife[i]) && scatter[i] > 0)
      variance = std::max(variance, jackknife[i] / scatter[i]);
  }
  const Jackknife even = jackknife_of_even_poses(observations, solution, options, held_out);
  const auto expected = mm(even.expected);
  variance = std::max(variance, ratio_of_variances(mm(even.found), expected));
  // The part of the covariance that observations give, without what all poses share (the print's size), which
  // no noise widens. Few poses with much leverage make `expected` larger than the whole.
  const double part = std::min(1.0, ratio_of_variances(scatter, expected));
  const MatrixXd widening = even.expected.allFinite() ? MatrixXd(part * even.expected) : solution.covariance;
  return {solution.covariance + (variance - 1) * widening,
          std::max(solution.corner_scatter_px, k_least_measured_px)};
}

}  // namespace limn::calib
