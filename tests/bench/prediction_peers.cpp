#include "tests/bench/prediction_peers.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace limn::test {
namespace {

class DoubleExponential final : public PosePredictor {
 public:
  explicit DoubleExponential(double alpha) : alpha_(alpha) {}

  void add(double at_s, const Pose& measured, const Matrix6d&) override {
    Vector7d value;
    value << measured.translation, measured.rotation.coeffs();
    if (!seen_) {
      once_ = twice_ = value;
    } else {
      if (value.tail<4>().dot(once_.tail<4>()) < 0) value.tail<4>() *= -1;  // the same rotation
      interval_s_ = at_s - at_s_;
      once_ = alpha_ * value + (1 - alpha_) * once_;
      twice_ = alpha_ * once_ + (1 - alpha_) * twice_;
    }
    seen_ = true;
    at_s_ = at_s;
  }

  Pose at(double at_s) const override {
    const double images = interval_s_ > 0 ? (at_s - at_s_) / interval_s_ : 0;
    const double ahead = images * alpha_ / (1 - alpha_);
    const Vector7d value = (2 + ahead) * once_ - (1 + ahead) * twice_;
    return {Eigen::Quaterniond(Eigen::Vector4d(value.tail<4>())), value.head<3>()};
  }

 private:
  using Vector7d = Eigen::Matrix<double, 7, 1>;
  double alpha_;
  bool seen_ = false;
  double at_s_ = 0, interval_s_ = 0;
  Vector7d once_ = Vector7d::Zero(), twice_ = Vector7d::Zero();
};

// Position and velocity along any of three axes that share their covariance.
struct Axes {
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();

  void predict(double dt, double density) {
    Eigen::Matrix2d f, q;
    f << 1, dt, 0, 1;
    q << dt * dt * dt / 3, dt * dt / 2, dt * dt / 2, dt;
    covariance = f * covariance * f.transpose() + density * q;
  }
  // The gains of position and velocity.
  Eigen::Vector2d correct(double variance) {
    const Eigen::Vector2d gain = covariance.col(0) / (covariance(0, 0) + variance);
    covariance -= gain * covariance.row(0);
    return gain;
  }
};

class ConstantVelocity final : public PosePredictor {
 public:
  explicit ConstantVelocity(double acceleration) : density_(acceleration) {}

  void add(double at_s, const Pose& measured, const Matrix6d& covariance) override {
    const double turn = covariance.diagonal().head<3>().mean(),
                 shift = covariance.diagonal().tail<3>().mean();
    if (!seen_) {
      constexpr double k_speed = 0.5, k_turn_speed = 2;  // standard deviations of a hand's
      pose_ = measured;
      turn_.covariance.diagonal() << turn, k_turn_speed * k_turn_speed;
      shift_.covariance.diagonal() << shift, k_speed * k_speed;
    } else {
      const double dt = at_s - at_s_;
      constexpr double k_turn_share = 20;
      turn_.predict(dt, k_turn_share * density_);
      shift_.predict(dt, density_);
      const Pose expected = at(at_s);
      const Vector6d off = boxminus(measured, expected);
      const Eigen::Vector2d turn_gain = turn_.correct(turn), shift_gain = shift_.correct(shift);
      Vector6d change;
      change << turn_gain[0] * off.head<3>(), shift_gain[0] * off.tail<3>();
      pose_ = boxplus(expected, change);
      velocity_.head<3>() += turn_gain[1] * off.head<3>();
      velocity_.tail<3>() += shift_gain[1] * off.tail<3>();
    }
    seen_ = true;
    at_s_ = at_s;
  }

  Pose at(double at_s) const override { return boxplus(pose_, (at_s - at_s_) * velocity_); }

 private:
  double density_;
  bool seen_ = false;
  double at_s_ = 0;
  Pose pose_;
  Vector6d velocity_ = Vector6d::Zero();
  Axes turn_, shift_;
};

}  // namespace

std::unique_ptr<PosePredictor> double_exponential(double alpha) {
  return std::make_unique<DoubleExponential>(std::clamp(alpha, 0.01, 0.99));
}

std::unique_ptr<PosePredictor> constant_velocity(double acceleration) {
  return std::make_unique<ConstantVelocity>(acceleration);
}

}  // namespace limn::test
