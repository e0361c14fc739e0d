#include "tracker/motion.h"

#include <Eigen/Dense>
#include <cmath>

namespace limn::tracker {
namespace {

Matrix6d per_axis(double turn, double shift) {
  Vector6d diagonal;
  diagonal << turn, turn, turn, shift, shift, shift;
  return diagonal.asDiagonal();
}

// Derivative of Exp(w + dw) as Exp(J dw) Exp(w), the left Jacobian of SO(3) (Solà et al., "A micro Lie
// theory", eq. 145).
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& w) {
  const Eigen::Matrix3d cross = skew(w);
  const double a2 = w.squaredNorm();
  const double a = std::sqrt(a2);
  const double first = a < 1e-4 ? 0.5 - a2 / 24 : (1 - std::cos(a)) / a2;
  const double second = a < 1e-4 ? 1. / 6 - a2 / 120 : (a - std::sin(a)) / (a2 * a);
  return Eigen::Matrix3d::Identity() + first * cross + second * cross * cross;
}

// Derivative of the motion after `dt` seconds, in which it moves by `delta`, with respect to the motion
// before:
// [diag(R, 1)  dt diag(J, 1)  dt²/2 diag(J, 1)]
// [    0             1               dt       ]
// [    0             0               1        ]
class Transition {
 public:
  Transition(const Vector6d& delta, double dt)
      : dt_(dt),
        turn_(exp_rotation(delta.head<3>()).toRotationMatrix()),
        jacobian_(left_jacobian(delta.head<3>())) {}

  Matrix18d operator*(const Matrix18d& m) const {
    const Eigen::Matrix<double, 6, 18> way = dt_ * m.middleRows<6>(6) + 0.5 * dt_ * dt_ * m.bottomRows<6>();
    Matrix18d out = m;
    out.topRows<3>() = turn_ * m.topRows<3>() + jacobian_ * way.topRows<3>();
    out.middleRows<3>(3) += way.bottomRows<3>();
    out.middleRows<6>(6) += dt_ * m.bottomRows<6>();
    return out;
  }

 private:
  double dt_;
  Eigen::Matrix3d turn_, jacobian_;
};

// Process noise: white jerk integrated over dt (Bar-Shalom, Li and Kirubarajan, "Estimation with applications
// to tracking and navigation", 6.2.3), and white velocity.
Matrix18d grown(const MotionNoise& noise, double dt) {
  const Matrix6d q = per_axis(noise.turn_jerk, noise.jerk);
  const double dt2 = dt * dt, dt3 = dt2 * dt;
  Matrix18d m = Matrix18d::Zero();
  m.block<6, 6>(0, 0) = dt2 * dt3 / 20 * q + dt * per_axis(noise.turn_drift, noise.drift);
  m.block<6, 6>(0, 6) = m.block<6, 6>(6, 0) = dt2 * dt2 / 8 * q;
  m.block<6, 6>(0, 12) = m.block<6, 6>(12, 0) = dt3 / 6 * q;
  m.block<6, 6>(6, 6) = dt3 / 3 * q;
  m.block<6, 6>(6, 12) = m.block<6, 6>(12, 6) = dt2 / 2 * q;
  m.block<6, 6>(12, 12) = dt * q;
  return m;
}

Matrix18d symmetric(const Matrix18d& m) { return 0.5 * (m + m.transpose()); }

Motion moved(const Motion& motion, const Eigen::Matrix<double, 18, 1>& delta) {
  Motion out = motion;
  out.world_from_body = boxplus(motion.world_from_body, delta.head<6>());
  out.velocity += delta.segment<6>(6);
  out.acceleration += delta.tail<6>();
  return out;
}

// What moves `from` to `to`.
Eigen::Matrix<double, 18, 1> difference(const Motion& to, const Motion& from) {
  Eigen::Matrix<double, 18, 1> delta;
  delta << boxminus(to.world_from_body, from.world_from_body), to.velocity - from.velocity,
      to.acceleration - from.acceleration;
  return delta;
}

double log_determinant(const Matrix6d& m) {
  return 2 * Eigen::LLT<Matrix6d>(m).matrixL().toDenseMatrix().diagonal().array().log().sum();
}

Vector6d moved_by(const Motion& motion, double seconds) {
  return seconds * motion.velocity + 0.5 * seconds * seconds * motion.acceleration;
}

}  // namespace

Pose pose_after(const Motion& motion, double seconds) {
  return boxplus(motion.world_from_body, moved_by(motion, seconds));
}

Motion propagated(const Motion& motion, double seconds, const MotionNoise& noise) {
  const Vector6d delta = moved_by(motion, seconds);
  Motion later = motion;
  later.world_from_body = boxplus(motion.world_from_body, delta);
  later.velocity += seconds * motion.acceleration;
  const Transition f(delta, seconds);
  later.covariance = symmetric(f * (f * motion.covariance).transpose() + grown(noise, seconds));
  return later;
}

PosePrior prior_of(const Motion& motion) {
  return {motion.world_from_body, motion.pose_covariance().llt().solve(Matrix6d::Identity())};
}

Motion corrected(const Motion& motion, const PoseFit& fit) {
  const Matrix6d prior = motion.pose_covariance();
  const Eigen::Matrix<double, 18, 6> gain =
      prior.llt().solve(motion.covariance.leftCols<6>().transpose()).transpose();
  Motion after = moved(motion, gain * boxminus(fit.world_from_body, motion.world_from_body));
  const Eigen::Matrix<double, 18, 6> change = gain * (fit.covariance - prior);
  after.covariance = symmetric(motion.covariance + change.lazyProduct(gain.transpose()));
  return after;
}

Motion combined(const Motion& a, const Motion& b) {
  constexpr double k_least_variance =
      1e-16;  // where both are certain, such as the velocity of what stands still
  const Matrix18d sum = a.covariance + b.covariance + k_least_variance * Matrix18d::Identity();
  const Matrix18d gain = sum.llt().solve(a.covariance).transpose();
  Motion out = moved(a, gain * difference(b, a));
  out.covariance = symmetric(a.covariance - gain * a.covariance);
  return out;
}

Motion mixed(const Motion& a, double weight_a, const Motion& b, double weight_b) {
  const Eigen::Matrix<double, 18, 1> apart = difference(b, a);
  Motion out = moved(a, weight_b * apart);
  out.covariance =
      weight_a * a.covariance + weight_b * b.covariance + weight_a * weight_b * apart * apart.transpose();
  return out;
}

double log_evidence(const Motion& prior, const PoseFit& fit) {
  return 0.5 * (log_determinant(fit.covariance) - log_determinant(prior.pose_covariance()) - fit.chi_square);
}

}  // namespace limn::tracker
