#include "tracker/pose_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/linear_algebra.h"

namespace limn::tracker {
namespace {

constexpr int k_max_steps = 60;
constexpr double k_small_gain = 1e-7;  // of the cost: three ten-thousandths of a standard deviation
// A step that is predicted to gain less and gains nothing has met the error of the prior's derivative.
constexpr double k_vain_gain = 1e-4;
// Far from corners that miss by much the robust cost is all but flat, and falls little for many steps.
constexpr int k_patient_steps = 10;
constexpr double k_slow_gain = 1e-3;       // of the cost
constexpr double k_min_condition = 1e-13;  // smallest over largest eigenvalue of the scaled normal matrix
constexpr double k_surely_regular = 1e8;   // norm of one times its inverse's, below which its factors suffice

// Robust weight of a squared normalised residual.
double weight(double square, double huber) {
  return huber > 0 && square > huber * huber ? huber / std::sqrt(square) : 1;
}
double loss(double square, double huber) {
  return huber > 0 && square > huber * huber ? 2 * huber * std::sqrt(square) - huber * huber : square;
}

// Sights that one call of the lens projects, and what it makes of them.
struct Batch {
  static constexpr std::size_t k_most = 16;
  std::span<const PointObservation> observations;            // of one camera
  std::array<Eigen::Vector3d, k_most> d_turned;  // from the body's origin, along the world's axes
  std::array<Eigen::Vector2d, k_most> px;
  std::array<PixelByPoint, k_most> by_camera;
  Eigen::Matrix3d camera_from_world;
};

bool is_same_camera(const PointObservation& a, const PointObservation& b) {
  return a.lens == b.lens && a.camera_from_world.translation == b.camera_from_world.translation &&
         a.camera_from_world.rotation.coeffs() == b.camera_from_world.rotation.coeffs();
}

std::span<const PointObservation> first_batch(std::span<const PointObservation> observations) {
  const std::size_t most = std::min(observations.size(), Batch::k_most);
  std::size_t count = 1;
  while (count < most && is_same_camera(observations[count], observations[0])) ++count;
  return observations.first(count);
}

// False when a point has no pixel.
bool project(const Pose& world_from_body, bool with_derivatives, Batch* batch) {
  const std::size_t count = batch->observations.size();
  const PointObservation& first = batch->observations[0];
  batch->camera_from_world = first.camera_from_world.rotation_matrix();
  const Eigen::Matrix3d world_from_body_turn = world_from_body.rotation_matrix();
  std::array<Eigen::Vector3d, Batch::k_most> p_camera;
  for (std::size_t i = 0; i < count; ++i) {
    batch->d_turned[i] = world_from_body_turn * batch->observations[i].p_body;
    p_camera[i] = batch->camera_from_world * (batch->d_turned[i] + world_from_body.translation) +
                  first.camera_from_world.translation;
    // Beside the camera some lens models go on projecting; a marker there is turned through itself.
    if (!(p_camera[i].z() > 0)) return false;
  }
  return first.lens->model.project_all(
      first.lens->values, std::span(p_camera).first(count), std::span(batch->px).first(count),
      with_derivatives ? std::span(batch->by_camera).first(count) : std::span<PixelByPoint>());
}

// Derivative of a residual by the delta of boxplus; transposed, it is summed up in half the time.
using Gradients = Eigen::Matrix<double, 6, 2>;

// Of a batch's i-th sight.
Gradients gradients(const Batch& batch, std::size_t i) {
  const Eigen::Matrix<double, 3, 2> by_world = (batch.by_camera[i] * batch.camera_from_world).transpose();
  Gradients by_delta;
  for (int k = 0; k < 2; ++k)  // a^T [t]x = (a x t)^T
    by_delta.col(k).head<3>() = by_world.col(k).cross(batch.d_turned[i]);
  by_delta.bottomRows<3>() = -by_world;
  return by_delta;
}

// Calls take(batch) for all sights, a batch at a time; false when a point has no pixel.
template <class Take>
bool each_batch(std::span<const PointObservation> observations,
                const Pose& world_from_body,
                bool with_derivatives,
                const Take& take) {
  Batch batch;
  for (; !observations.empty(); observations = observations.subspan(batch.observations.size())) {
    batch.observations = first_batch(observations);
    if (!project(world_from_body, with_derivatives, &batch)) return false;
    take(batch);
  }
  return true;
}

// A pose as the sights and its prior judge it.
struct Judged {
  double cost = 0;     // robust, in squared standard deviations, the prior's included
  double squares = 0;  // px^2
  Matrix6d normal = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
};

void add_sight(const PointObservation& observation,
               const Eigen::Vector2d& px,
               const Gradients& by_delta,
               double huber,
               Judged* judged) {
  const Eigen::Vector2d r = observation.px - px;
  const Eigen::Vector2d weighed = observation.information * r;
  const double square = r.dot(weighed), w = weight(square, huber);
  judged->cost += loss(square, huber);
  judged->squares += r.squaredNorm();
  const Gradients weighed_by_delta = by_delta * (w * observation.information);
  judged->normal.noalias() += weighed_by_delta * by_delta.transpose();
  judged->gradient.noalias() += by_delta * (w * weighed);
}

// The delta's own derivative by a further small step is taken for the identity: a prior is far narrower than
// a radian.
void add_prior(const PosePrior& prior, const Pose& pose, Judged* judged) {
  const Vector6d delta = boxminus(pose, prior.world_from_body);
  const Vector6d weighed = prior.information * delta;
  judged->cost += delta.dot(weighed);
  judged->normal += prior.information;
  judged->gradient += weighed;
}

// nullopt when a point has no pixel.
std::optional<Judged> judged(std::span<const PointObservation> observations,
                             const Pose& pose,
                             double huber,
                             const PosePrior* prior) {
  Judged sum;
  const bool is_seen = each_batch(observations, pose, true, [&](const Batch& batch) {
    for (std::size_t i = 0; i < batch.observations.size(); ++i)
      add_sight(batch.observations[i], batch.px[i], gradients(batch, i), huber, &sum);
  });
  if (!is_seen) return std::nullopt;
  if (prior) add_prior(*prior, pose, &sum);
  return sum;
}

// Inverse of a normal matrix, scaled so that radians and metres compare; nullopt when it is singular.
std::optional<Matrix6d> inverse(const Matrix6d& matrix) {
  const Vector6d diagonal = matrix.diagonal();
  if (!matrix.allFinite() || !(diagonal.minCoeff() > 0)) return std::nullopt;
  const Vector6d scale = diagonal.cwiseSqrt().cwiseInverse();
  const Matrix6d scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  const Eigen::LLT<Matrix6d> factor(scaled);
  if (factor.info() == Eigen::Success) {
    const Matrix6d middle = factor.solve(Matrix6d::Identity());
    if (scaled.norm() * middle.norm() < k_surely_regular)
      return Matrix6d(scale.asDiagonal() * middle * scale.asDiagonal());
  }
  const EigenPairs6 eigen = eigen_pairs(scaled);
  if (!(eigen.values[0] > k_min_condition * eigen.values[5])) return std::nullopt;
  const Matrix6d middle = eigen.vectors * eigen.values.cwiseInverse().asDiagonal() *
                          eigen.vectors.transpose();
  return Matrix6d(scale.asDiagonal() * middle * scale.asDiagonal());
}

}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

bool residual(const PointObservation& observation,
              const Pose& world_from_body,
              Eigen::Vector2d* difference,
              Eigen::Matrix<double, 2, 6>* d_difference) {
  return each_batch(std::span(&observation, 1), world_from_body, d_difference, [&](const Batch& batch) {
    *difference = observation.px - batch.px[0];
    if (d_difference) *d_difference = gradients(batch, 0).transpose();
  });
}

double cost(std::span<const PointObservation> observations, const Pose& world_from_body, double huber) {
  double sum = 0;
  const bool is_seen = each_batch(observations, world_from_body, false, [&](const Batch& batch) {
    for (std::size_t i = 0; i < batch.observations.size(); ++i) {
      const Eigen::Vector2d r = batch.observations[i].px - batch.px[i];
      sum += loss(r.dot(batch.observations[i].information * r), huber);
    }
  });
  return is_seen ? sum : std::numeric_limits<double>::infinity();
}

std::optional<PoseFit> fit_pose(std::span<const PointObservation> observations,
                                const Pose& start,
                                double huber,
                                const PosePrior* prior) {
  if (observations.size() < 3 || !start.is_finite()) return std::nullopt;
  Pose pose = start;
  auto best = judged(observations, pose, huber, prior);
  if (!best || !std::isfinite(best->cost)) return std::nullopt;
  double damping = 1e-6;
  for (int step = 0; step < k_max_steps; ++step) {
    Matrix6d damped = best->normal;
    damped.diagonal() *= 1 + damping;
    const Vector6d delta = solve_ldlt(damped, -best->gradient);
    if (!delta.allFinite()) return std::nullopt;
    const double gain = -best->gradient.dot(delta);
    const bool is_last = gain < k_small_gain || (step >= k_patient_steps && gain < k_slow_gain * best->cost);
    const Pose next = boxplus(pose, delta);
    const auto after = judged(observations, next, huber, prior);
    if (after && after->cost <= best->cost) {
      pose = next;
      best = after;
      damping = std::max(1e-12, damping * 0.1);
    } else {
      damping = std::max(damping, 1e-9) * 10;
      if (damping > 1e8 || gain < k_vain_gain) break;
    }
    if (is_last) break;
  }
  const auto covariance = inverse(best->normal);
  if (!covariance || !covariance->allFinite() || !pose.is_finite()) return std::nullopt;
  return PoseFit{pose, *covariance, best->cost,
                 std::sqrt(best->squares / static_cast<double>(observations.size()))};
}

}  // namespace limn::tracker
