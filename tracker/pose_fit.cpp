#include "tracker/pose_fit.h"

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "core/linear_algebra.h"

namespace limn::tracker {
namespace {

constexpr int k_max_steps = 60;
constexpr double k_small_gain = 1e-10;  // of the cost: a hundred thousandth of a standard deviation
// Far from corners that miss by much the robust cost is all but flat, and falls little for many steps.
constexpr int k_patient_steps = 10;
constexpr double k_slow_gain = 1e-3;       // of the cost
constexpr double k_min_condition = 1e-13;  // smallest over largest eigenvalue of the scaled normal matrix

struct Normal {
  Matrix6d matrix = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
};

// Robust weight of a squared normalised residual.
double weight(double square, double huber) {
  return huber > 0 && square > huber * huber ? huber / std::sqrt(square) : 1;
}
double loss(double square, double huber) {
  return huber > 0 && square > huber * huber ? 2 * huber * std::sqrt(square) - huber * huber : square;
}

double prior_cost(const PosePrior* prior, const Pose& pose) {
  if (!prior) return 0;
  const Vector6d delta = boxminus(pose, prior->world_from_body);
  return delta.dot(prior->information * delta);
}

// The delta's own derivative by a further small step is taken for the identity: a prior is far narrower than
// a radian.
std::optional<Normal> normal_equations(std::span<const PointSight> sights,
                                       const Pose& pose,
                                       double huber,
                                       const PosePrior* prior) {
  Normal normal;
  if (prior) {
    normal.matrix = prior->information;
    normal.gradient = prior->information * boxminus(pose, prior->world_from_body);
  }
  for (const PointSight& sight : sights) {
    Eigen::Vector2d r;
    Eigen::Matrix<double, 2, 6> j;
    if (!residual(sight, pose, &r, &j)) return std::nullopt;
    const double w = weight(r.dot(sight.information * r), huber);
    normal.matrix += w * j.transpose() * sight.information * j;
    normal.gradient += w * j.transpose() * (sight.information * r);
  }
  return normal;
}

// Inverse of a normal matrix, scaled so that radians and metres compare; nullopt when it is singular.
std::optional<Matrix6d> inverse(const Matrix6d& matrix) {
  const Vector6d diagonal = matrix.diagonal();
  if (!matrix.allFinite() || !(diagonal.minCoeff() > 0)) return std::nullopt;
  const Vector6d scale = diagonal.cwiseSqrt().cwiseInverse();
  const Matrix6d scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  const EigenPairs6 eigen = eigen_pairs(scaled);
  if (!(eigen.values[0] > k_min_condition * eigen.values[5])) return std::nullopt;
  const Matrix6d middle = eigen.vectors * eigen.values.cwiseInverse().asDiagonal() *
                          eigen.vectors.transpose();
  return Matrix6d(scale.asDiagonal() * middle * scale.asDiagonal());
}

double rms(std::span<const PointSight> sights, const Pose& pose) {
  double squares = 0;
  for (const PointSight& sight : sights) {
    Eigen::Vector2d r;
    if (!residual(sight, pose, &r)) return std::numeric_limits<double>::infinity();
    squares += r.squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(sights.size()));
}

}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

bool residual(const PointSight& sight,
              const Pose& world_from_body,
              Eigen::Vector2d* difference,
              Eigen::Matrix<double, 2, 6>* d_difference) {
  const Eigen::Vector3d turned = world_from_body.rotation * sight.p_body;
  const Eigen::Vector3d p_camera = sight.camera_from_world * (turned + world_from_body.translation);
  Eigen::Vector2d px;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_px;
  // Beside the camera some lens models go on projecting; a marker there is turned through itself.
  if (!(p_camera.z() > 0)) return false;
  if (!sight.lens->model.project(sight.lens->values, p_camera, &px, d_difference ? d_px.data() : nullptr))
    return false;
  if (!px.allFinite()) return false;
  *difference = sight.px - px;
  if (d_difference) {
    const Eigen::Matrix<double, 2, 3> d_world = d_px * sight.camera_from_world.rotation_matrix();
    d_difference->leftCols<3>() = d_world * skew(turned);  // minus from the residual, minus from -[R p]x
    d_difference->rightCols<3>() = -d_world;
  }
  return true;
}

double cost(std::span<const PointSight> sights, const Pose& world_from_body, double huber) {
  double sum = 0;
  for (const PointSight& sight : sights) {
    Eigen::Vector2d r;
    if (!residual(sight, world_from_body, &r)) return std::numeric_limits<double>::infinity();
    sum += loss(r.dot(sight.information * r), huber);
  }
  return sum;
}

std::optional<PoseFit> fit_pose(std::span<const PointSight> sights,
                                const Pose& start,
                                double huber,
                                const PosePrior* prior) {
  if (sights.size() < 3 || !start.is_finite()) return std::nullopt;
  Pose pose = start;
  double best = cost(sights, pose, huber) + prior_cost(prior, pose);
  if (!std::isfinite(best)) return std::nullopt;
  double damping = 1e-6;
  for (int step = 0; step < k_max_steps; ++step) {
    const auto normal = normal_equations(sights, pose, huber, prior);
    if (!normal) return std::nullopt;
    Matrix6d damped = normal->matrix;
    damped.diagonal() *= 1 + damping;
    const Vector6d delta = solved(damped, -normal->gradient);
    if (!delta.allFinite()) return std::nullopt;
    const double gain = -normal->gradient.dot(delta);
    const bool is_last = gain < k_small_gain || (step >= k_patient_steps && gain < k_slow_gain * best);
    const Pose next = boxplus(pose, delta);
    const double next_cost = cost(sights, next, huber) + prior_cost(prior, next);
    if (next_cost <= best) {
      pose = next;
      best = next_cost;
      damping = std::max(1e-12, damping * 0.1);
    } else {
      damping = std::max(damping, 1e-9) * 10;
      if (damping > 1e8) break;
    }
    if (is_last) break;
  }
  const auto normal = normal_equations(sights, pose, huber, prior);
  if (!normal) return std::nullopt;
  const auto covariance = inverse(normal->matrix);
  if (!covariance || !covariance->allFinite() || !pose.is_finite()) return std::nullopt;
  return PoseFit{pose, *covariance, best, rms(sights, pose)};
}

}  // namespace limn::tracker
