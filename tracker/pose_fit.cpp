#include "tracker/pose_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/least_squares.h"
#include "core/linear_algebra.h"

namespace limn::tracker {
namespace {

constexpr int k_max_steps = 60;
constexpr double k_small_gain = 1e-7;  // difference of cost: three ten-thousandths of a standard deviation
// Where a predicted gain below this is not reached, the error in the prior's derivative limits the fit.
constexpr double k_vain_gain = 1e-4;
// Far from corners with large residuals the robust cost is nearly flat and falls little for many steps.
constexpr int k_patient_steps = 10;
constexpr double k_slow_gain = 1e-3;       // share of the cost
constexpr double k_min_condition = 1e-13;  // smallest over largest eigenvalue of the scaled normal matrix
constexpr double k_surely_regular = 1e8;   // condition number below which the Cholesky factors suffice

// Observations that are projected by one call of the lens, and the result.
struct Batch {
  static constexpr std::size_t k_most = 16;
  std::span<const PointObservation> observations;  // all of one camera
  std::array<Eigen::Vector3d, k_most> d_turned;    // from the body's origin, along the world's axes
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
    // Some lens models also project points behind the camera; a marker there would be mirrored.
    if (!(p_camera[i].z() > 0)) return false;
  }
  return first.lens->model.project_all(
      first.lens->values, std::span(p_camera).first(count), std::span(batch->px).first(count),
      with_derivatives ? std::span(batch->by_camera).first(count) : std::span<PixelByPoint>());
}

// Derivative of a residual by the delta of boxplus; it is transposed because sums are then twice as fast.
using Gradients = Eigen::Matrix<double, 6, 2>;

// Derivative for the i-th observation of a batch.
Gradients gradients(const Batch& batch, std::size_t i) {
  const Eigen::Matrix<double, 3, 2> by_world = (batch.by_camera[i] * batch.camera_from_world).transpose();
  Gradients by_delta;
  for (int k = 0; k < 2; ++k)  // a^T [t]x = (a x t)^T
    by_delta.col(k).head<3>() = by_world.col(k).cross(batch.d_turned[i]);
  by_delta.bottomRows<3>() = -by_world;
  return by_delta;
}

// Calls use_batch(batch) for all observations, a batch at a time. False when a point has no pixel.
template <class Use>
bool each_batch(std::span<const PointObservation> observations,
                const Pose& world_from_body,
                bool with_derivatives,
                const Use& use_batch) {
  Batch batch;
  for (; !observations.empty(); observations = observations.subspan(batch.observations.size())) {
    batch.observations = first_batch(observations);
    if (!project(world_from_body, with_derivatives, &batch)) return false;
    use_batch(batch);
  }
  return true;
}

// A pose with its cost and normal equations.
struct Judged {
  double cost = 0;     // robust, of squared normalised residuals, with the prior's
  double squares = 0;  // px^2
  Matrix6d normal = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
};

void add_observation(const PointObservation& observation,
                     const Eigen::Vector2d& px,
                     const Gradients& by_delta,
                     const HuberLoss& loss,
                     Judged* judged) {
  const Eigen::Vector2d r = observation.px - px;
  const Eigen::Vector2d weighed = observation.information * r;
  const double square = r.dot(weighed), w = loss.weight(square);
  judged->cost += loss.cost(square);
  judged->squares += r.squaredNorm();
  const Gradients weighed_by_delta = by_delta * (w * observation.information);
  judged->normal.noalias() += weighed_by_delta * by_delta.transpose();
  judged->gradient.noalias() += by_delta * (w * weighed);
}

// The derivative of delta by a further small step is taken as the identity, because a prior is far narrower
// than a radian.
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
                             const HuberLoss& loss,
                             const PosePrior* prior) {
  Judged sum;
  const bool is_seen = each_batch(observations, pose, true, [&](const Batch& batch) {
    for (std::size_t i = 0; i < batch.observations.size(); ++i)
      add_observation(batch.observations[i], batch.px[i], gradients(batch, i), loss, &sum);
  });
  if (!is_seen) return std::nullopt;
  if (prior) add_prior(*prior, pose, &sum);
  return sum;
}

// The problem for minimise(): the equations are computed together with the cost. Nothing is allocated.
struct PoseProblem {
  std::span<const PointObservation> observations;
  HuberLoss loss;
  const PosePrior* prior;
  Pose pose;
  std::optional<Judged> at_pose;
  Pose next{};
  std::optional<Judged> at_next{};
  Vector6d delta{};
  double promised = 0;  // how far the cost falls at least, if the linear equations are exact

  double cost() const { return at_pose ? at_pose->cost : std::numeric_limits<double>::infinity(); }
  bool solve(double damping) {
    delta = solve_ldlt(damped(at_pose->normal, damping), -at_pose->gradient);
    promised = -at_pose->gradient.dot(delta);
    return delta.allFinite();
  }
  double evaluate_trial() {
    next = boxplus(pose, delta);
    at_next = judged(observations, next, loss, prior);
    return at_next ? at_next->cost : std::numeric_limits<double>::infinity();
  }
  void accept_trial() {
    pose = next;
    at_pose = at_next;
  }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return promised < k_small_gain ||
           (tried.step >= k_patient_steps && promised < k_slow_gain * tried.cost_before) ||
           (!tried.is_accepted && promised < k_vain_gain);
  }
};

// Inverse of a normal matrix, scaled to make radians and metres comparable; nullopt when it is singular.
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
  const Matrix6d middle =
      eigen.vectors * eigen.values.cwiseInverse().asDiagonal() * eigen.vectors.transpose();
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
  const HuberLoss loss{huber};
  double sum = 0;
  const bool is_seen = each_batch(observations, world_from_body, false, [&](const Batch& batch) {
    for (std::size_t i = 0; i < batch.observations.size(); ++i) {
      const Eigen::Vector2d r = batch.observations[i].px - batch.px[i];
      sum += loss.cost(r.dot(batch.observations[i].information * r));
    }
  });
  return is_seen ? sum : std::numeric_limits<double>::infinity();
}

std::optional<PoseFit> fit_pose(std::span<const PointObservation> observations,
                                const Pose& start,
                                double huber,
                                const PosePrior* prior) {
  if (observations.size() < 3 || !start.is_finite()) return std::nullopt;
  PoseProblem problem{.observations = observations,
                      .loss = {huber},
                      .prior = prior,
                      .pose = start,
                      .at_pose = judged(observations, start, {huber}, prior)};
  const LeastSquaresSummary found = minimise(
      &problem, {.max_steps = k_max_steps, .first_damping = 1e-6, .most_damping = 5e8, .raised_from = 1e-9});
  if (found.end == LeastSquaresEnd::no_start || found.end == LeastSquaresEnd::no_step) return std::nullopt;
  const Pose& pose = problem.pose;
  const std::optional<Judged>& best = problem.at_pose;
  const auto covariance = inverse(best->normal);
  if (!covariance || !covariance->allFinite() || !pose.is_finite()) return std::nullopt;
  return PoseFit{pose, *covariance, best->cost,
                 std::sqrt(best->squares / static_cast<double>(observations.size()))};
}

}  // namespace limn::tracker
