#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

#include "remote/glasses/glasses_registration.h"
#include "tests/support/random.h"

namespace limn::test {

using Eigen::Vector3d;
using remote::GlassesPlace;
using remote::GlassesRegistration;
using remote::MeasuredMarker;

inline constexpr double k_degree = std::numbers::pi / 180;

inline Vector3d random_vector(std::mt19937_64& rng, double most) {
  return {uniform(rng, -most, most), uniform(rng, -most, most), uniform(rng, -most, most)};
}

inline Vector6d noise(std::mt19937_64& rng, double rotation, double translation) {
  std::normal_distribution<double> normal;
  Vector6d delta;
  for (int k = 0; k < 6; ++k) delta[k] = (k < 3 ? rotation : translation) * normal(rng);
  return delta;
}

/// A person with a headset whose odometry drifts, about 1.5 m from the world's origin. The cameras measure
/// its marker 60 times a second with 2 mrad and 0.5 mm of noise; its page sends 30 poses a second with a
/// clock of its own.
class Headset {
 public:
  static constexpr double k_marker_rad = 2e-3, k_marker_m = 0.5e-3;

  explicit Headset(std::uint64_t seed) : rng_(seed) {
    for (double& phase : phases_) phase = uniform(rng_, 0, 2 * std::numbers::pi);
    world_from_feed_ = Pose(exp_rotation(random_vector(rng_, 3)), random_vector(rng_, 2));
    marker_from_eye_ = Pose(exp_rotation(random_vector(rng_, 2)), random_vector(rng_, 0.08));
    clock_s_ = uniform(rng_, -1e4, 1e4);
    delay_s_ = uniform(rng_, -0.05, 0.05);
    creep_ = noise(rng_, 0.005 * k_degree, 0.1e-3);
  }

  // What the person does; 0: stands still.
  double turn_rad = 0.6, nod_rad = 0.4, roll_rad = 0.15, walk_m = 0.15;
  bool is_marker_seen = true, sends_poses = true;
  int pose_every = 4;                                    // steps of 1/120 s
  double drift_rad = 0.02 * k_degree, drift_m = 0.3e-3;  // in a second, as a random walk

  Pose world_from_eye(double at_s) const {
    at_s = std::min(at_s, stands_from_s_);
    const auto wave = [&](int i, double period_s) {
      return std::sin(2 * std::numbers::pi * at_s / period_s + phases_[i]);
    };
    const Vector3d w(nod_rad * wave(0, 2.9) + 0.2 * nod_rad * wave(6, 1.1), turn_rad * wave(1, 2.3),
                     roll_rad * wave(2, 3.7));
    const Vector3d p(walk_m * wave(3, 5), walk_m * wave(4, 4.1) - 1.5, 0.3 * walk_m * wave(5, 3.3) + 0.4);
    return Pose(
        Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * std::numbers::pi, Vector3d::UnitX())) * exp_rotation(w),
        p);
  }

  // Plays time on, up to `until_s`, in steps of 1/120 s. `send` gets a pose, when the page's clock gave it
  // and when it arrives; `measure` a measured marker; `update` is called twenty times a second.
  void play(double until_s,
            const std::function<void(const Pose&, double page_s, double received_s)>& send,
            const std::function<void(const MeasuredMarker&)>& measure,
            const std::function<void(double at_s)>& update) {
    for (; at_s_ < until_s; at_s_ += 1.0 / 120, ++step_) {
      const Pose eye = world_from_eye(at_s_);
      drift(eye.translation);
      if (sends_poses && step_ % pose_every == 0) {
        const Pose feed = boxplus(world_from_feed_.inverse() * eye, noise(rng_, 0.2e-3, 0.1e-3));
        send(feed, at_s_ - clock_s_ - delay_s_, at_s_ + uniform(rng_, 0.005, 0.03));
      }
      if (is_marker_seen && step_ % 2 == 1) {
        MeasuredMarker marker{
            at_s_, boxplus(eye * marker_from_eye_.inverse(), noise(rng_, k_marker_rad, k_marker_m))};
        marker.covariance = Matrix6d::Zero();
        marker.covariance.diagonal() << Vector3d::Constant(k_marker_rad * k_marker_rad),
            Vector3d::Constant(k_marker_m * k_marker_m);
        measure(marker);
      }
      if (step_ % 6 == 0) update(at_s_);
    }
  }

  void play(double until_s, GlassesRegistration* registration) {
    play(
        until_s,
        [&](const Pose& feed, double page_s, double received_s) {
          const Eigen::Quaterniond& q = feed.rotation;
          sent = registration->add_eye({q.w(), q.x(), q.y(), q.z()}, feed.translation, page_s, received_s);
        },
        [&](const MeasuredMarker& marker) { registration->add_marker(marker); },
        [&](double at_s) { registration->update(at_s); });
  }
  // The odometry finds itself elsewhere.
  void jump() { world_from_feed_ = world_from_feed_ * Pose(exp_rotation({0, 0.3, 0}), {0.2, 0, 0.1}); }

  // From now on the head does not move.
  void stand_still() { stands_from_s_ = at_s_; }
  // Somebody fixes the marker elsewhere.
  void move_marker() {
    marker_from_eye_ = Pose(exp_rotation({0.2, -0.1, 0.2}), {0.02, 0.01, -0.02}) * marker_from_eye_;
  }

  // The error of the eye in the world: [rotation; translation].
  Vector6d error_of(const GlassesPlace& place) const {
    const Pose eye = world_from_eye(at_s_);
    return boxminus(place.world_from_feed * (world_from_feed_.inverse() * eye), eye);
  }
  // The covariance that is stated for it.
  Matrix6d stated(const GlassesPlace& place) const {
    const Vector3d p =
        place.world_from_feed.rotation * (world_from_feed_.inverse() * world_from_eye(at_s_)).translation;
    Matrix6d at_eye = Matrix6d::Identity();
    at_eye.block<3, 3>(3, 0) << 0, p.z(), -p.y(), -p.z(), 0, p.x(), p.y(), -p.x(), 0;
    return at_eye * place.covariance * at_eye.transpose();
  }
  const Pose& marker_from_eye() const { return marker_from_eye_; }
  double offset_s() const { return clock_s_ + delay_s_; }
  double at_s() const { return at_s_; }
  Status sent;

 private:
  // The feed moves about the head, slowly.
  void drift(const Vector3d& p_head) {
    const double root = std::sqrt(1.0 / 120);
    const Vector6d moved = noise(rng_, root * drift_rad, root * drift_m) + creep_ / 120;
    const Eigen::Quaterniond turned = exp_rotation(moved.head<3>());
    world_from_feed_ = Pose(turned * world_from_feed_.rotation,
                            p_head + turned * (world_from_feed_.translation - p_head) + moved.tail<3>());
  }

  std::mt19937_64 rng_;
  double phases_[7] = {};
  Pose world_from_feed_, marker_from_eye_;
  Vector6d creep_;
  double clock_s_ = 0, delay_s_ = 0, at_s_ = 100;
  double stands_from_s_ = std::numeric_limits<double>::infinity();
  int step_ = 0;
};

}  // namespace limn::test
